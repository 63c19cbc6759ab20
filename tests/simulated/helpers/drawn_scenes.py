"""Hostile scenes drawn at random: of each kind as many as wanted, every one of another body, camera, size, phase, light
and noise. Each has one planted cause; what counts is the first sentence of the reason.

Run it for the whole table: python tests/simulated/helpers/drawn_scenes.py SEED [KIND ...]
"""

import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from hostile import NAMED, Hostile, corrected, is_reported, off_px, texture_of
from ray_caster import Body, blotches, body_at, exposed, pose_of, rendered, unit

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target

Image = np.ndarray
BODIES = ("europa", "io", "ganymede", "callisto", "mimas", "tethys", "rhea", "triton", "moon", "pluto")
MAPPED = ("europa", "io", "ganymede", "callisto", "moon", "pluto")


@dataclass(frozen=True)
class Drawn:
    """What a scene is made of: camera, target, true pose, the pose that metadata have, and the picture."""

    camera: Camera
    target: str
    truth: Pose
    given: Pose
    image: Image
    radius_px: float
    seed: int


def drawn(rng: np.random.Generator, bodies: tuple[str, ...] = BODIES, **fixed: Any) -> Drawn:
    """A usual scene. fixed: radius_px, centre_px, phase_deg, psf_px, peak, behind (more bodies), instead of drawn."""
    side = int(rng.integers(170, 260))
    camera = Camera(
        name="drawn",
        size_px=(side, side),
        centre_px=((side - 1) / 2, (side - 1) / 2),
        focal_length_px=float(10 ** rng.uniform(4.0, 5.3)),
    )
    target = str(rng.choice(bodies))
    radius = fixed.get("radius_px", float(rng.uniform(22, 0.22 * side)))
    room = max(side / 2 - radius - 12, 0)
    centre = fixed.get("centre_px", tuple((side - 1) / 2 + rng.uniform(-room, room, 2)))
    above = (float(rng.uniform(0, 360)), float(rng.uniform(-35, 35)))
    phase = fixed.get("phase_deg", float(rng.uniform(20, 95)))
    pose = pose_of(camera, find_target(target).mean_radius_km, radius, centre, above, above, float(rng.uniform(0, 360)))
    pose = pose.replaced(sun_from_target_km=sun_of(unit(*above), phase, rng))
    seed = int(rng.integers(1 << 30))
    made = Drawn(camera, target, pose, metadata_of(pose, camera, rng), np.zeros((side, side)), radius, seed)
    return replace(made, image=picture(made, rng=rng, **{k: v for k, v in fixed.items() if k in ("psf_px", "peak")}))


def sun_of(towards_spacecraft: np.ndarray, phase_deg: float, rng: np.random.Generator) -> np.ndarray:
    """Sun at a phase angle, in any direction around."""
    axis = np.cross(towards_spacecraft, rng.standard_normal(3))
    return rotation_from_vector_deg(phase_deg * axis / np.linalg.norm(axis)) @ towards_spacecraft * 7.4e8


def metadata_of(truth: Pose, camera: Camera, rng: np.random.Generator) -> Pose:
    """A pose as metadata have it: some pixels, some tenths of a per cent of range and of a degree off."""
    off = np.degrees(rng.uniform(-9, 9, 2) / camera.focal_length_px)
    turn, body = rotation_from_vector_deg([-off[1], off[0], 0]), rotation_from_vector_deg(rng.uniform(-0.2, 0.2, 3))
    moved = truth.replaced(camera_from_j2000=turn @ truth.camera_from_j2000, body_from_j2000=body)
    return moved.with_range_factor(float(rng.uniform(0.997, 1.003)))


def texture(made: Drawn) -> Image:
    """The catalog's map of the target; blurred noise where there is none."""
    return texture_of(made.target) if find_target(made.target).basemap else blotches(made.seed % 1000, 0.12)


def picture(
    made: Drawn,
    rng: np.random.Generator,
    surface: Image | None = None,
    psf_px: float | None = None,
    peak: float | None = None,
    others: tuple[Body, ...] = (),
) -> Image:
    """Data numbers; the surface is the target's own unless given."""
    law = float(rng.uniform(0.2, 0.8))
    body = body_at(made.truth, find_target(made.target).radii_km, texture(made) if surface is None else surface)
    radiance = rendered(made.truth, made.camera, [replace(body, lambert=law), *others], psf_px or rng.uniform(0.7, 1.2))
    return exposed(radiance, made.seed, peak or float(rng.uniform(600, 3500)))


def scene_of(made: Drawn, cause: str, image: Image | None = None, **changed: Any) -> Hostile:
    """The scene; solved is right, too, unless `truth` is None."""
    given = {"pose": made.given, "camera": made.camera, "target": made.target, "truth": made.truth} | changed
    return Hostile("", cause, made.image if image is None else image, **given)


def side_of(made: Drawn) -> int:
    return int(made.camera.size_px[0])


def other_range(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    factor = 1 + float(rng.choice([-1, 1]) * rng.uniform(0.1, 0.3))
    return scene_of(made, "size", pose=made.given.with_range_factor(factor))


def other_mode(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, radius_px=float(rng.uniform(24, 45)))
    focal = made.camera.focal_length_px * float(rng.choice([0.5, 2.0]))
    return scene_of(made, "mode", camera=made.camera.model_copy(update={"focal_length_px": focal}))


def other_camera(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    focal = made.camera.focal_length_px * float(rng.choice([rng.uniform(0.66, 0.87), rng.uniform(1.15, 1.5)]))
    return scene_of(made, "size", camera=made.camera.model_copy(update={"focal_length_px": focal}))


def other_target(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    radius = find_target(made.target).mean_radius_km
    ratios = {name: find_target(name).mean_radius_km / radius for name in BODIES}
    apart = [name for name, ratio in ratios.items() if 0.42 < ratio < 2.4 and abs(ratio - 1) > 0.12]
    return scene_of(made, "size", target=str(rng.choice(apart)), truth=None)


def sun_turned(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, phase_deg=float(rng.uniform(35, 100)))
    sight = made.given.target_from_spacecraft_km / made.given.range_km
    turn = rotation_from_vector_deg(float(rng.uniform(50, 300)) * sight)
    return scene_of(made, "sun", pose=made.given.replaced(sun_from_target_km=turn @ made.given.sun_from_target_km))


def sun_of_another_time(rng: np.random.Generator) -> Hostile:
    """Another phase angle: of a wrong time or kernel."""
    made = drawn(rng, phase_deg=float(rng.uniform(20, 60)))
    back = -made.given.target_from_spacecraft_km / made.given.range_km
    sun = sun_of(back, float(rng.uniform(95, 125)), rng)
    return scene_of(made, "sun", pose=made.given.replaced(sun_from_target_km=sun))


def mirrored(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, MAPPED, phase_deg=float(rng.uniform(30, 90)))
    way = int(rng.integers(2))
    return scene_of(made, "mirrored", np.flip(made.image, axis=way).copy(), truth=None)


def quarter_turned(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, MAPPED, phase_deg=float(rng.uniform(30, 90)))
    return scene_of(made, "turned", np.rot90(made.image, int(rng.integers(1, 4))).copy(), truth=None)


def negative(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "negative", made.image.max() + 20 - made.image)


def noise_only(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "empty", rng.normal(20, 6, made.image.shape), truth=None)


def outside(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, centre_px=(-150.0, float(rng.uniform(20, 180))), radius_px=float(rng.uniform(24, 60)))
    inside = pose_of(made.camera, 1000.0, 40.0, (100.0, 100.0))
    return scene_of(made, "outside", exposed(rendered(inside, made.camera, []) + 0.0, made.seed), truth=None)


def too_faint(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "faint", picture(made, rng, peak=float(rng.uniform(0.3, 1.2))))


def clouded(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, MAPPED)
    return scene_of(made, "map", picture(made, rng, surface=blotches(made.seed % 999, float(rng.uniform(0.3, 0.55)))))


def map_of_another(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, MAPPED)
    other = str(rng.choice([name for name in MAPPED if name != made.target]))
    return scene_of(made, "map", picture(made, rng, surface=texture_of(other)))


def another_face(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, MAPPED)
    turn = rotation_from_vector_deg([0, 0, float(rng.uniform(60, 300))])
    return scene_of(made, "map", pose=made.given.replaced(body_from_j2000=turn @ made.given.body_from_j2000))


def saturated(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "saturated", np.round(np.minimum(made.image, 0.06 * made.image.max())))


def limb_saturated(rng: np.random.Generator) -> Hostile:
    """The bright limb is clipped, the rest of the disk is not."""
    made = drawn(rng, phase_deg=float(rng.uniform(15, 60)))
    clip = float(np.percentile(made.image[made.image > 0.1 * made.image.max()], 55))
    return scene_of(made, "saturated", np.round(np.minimum(made.image, clip)))


def hot_pixels(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    image, side = np.round(20 + (made.image - 20) * 0.3), side_of(made)
    image[rng.integers(0, side, 90), rng.integers(0, side, 90)] = 4095
    return scene_of(made, "specks", image)


def missing_lines(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    image = made.image.copy()
    image[np.arange(side_of(made)) % 3 != int(rng.integers(3))] = np.nan
    return scene_of(made, "lines", image)


def zero_filled(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    image, first = made.image.copy(), int(rng.integers(20, side_of(made) // 2))
    image[first : first + side_of(made) // 2 : 2] = 0
    return scene_of(made, "lines", image)


def truncated(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    image = made.image.copy()
    _, y = made.camera.project(made.truth.target_in_camera_km)
    image[int(max(y - made.radius_px * rng.uniform(0.6, 1.2), 8)) :] = 0 if rng.integers(2) else np.nan
    return scene_of(made, "lines", image)


def blurred(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "blur", picture(made, rng, psf_px=float(rng.uniform(0.11, 0.2)) * made.radius_px))


def smeared(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    length = int(made.radius_px * rng.uniform(0.5, 0.9))
    line = np.zeros((2 * length + 1, 2 * length + 1), np.uint8)
    dx, dy = (length / 2 * f(rng.uniform(0, np.pi)) for f in (np.cos, np.sin))
    ends = ((int(length - dx), int(length - dy)), (int(length + dx), int(length + dy)))
    kernel = cv2.line(line, *ends, 1).astype(np.float64)
    clean = cv2.filter2D(made.image - 20, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)
    return scene_of(made, "blur", clean + 20 + rng.normal(0, 5, clean.shape))


def planet_beside(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, radius_px=float(rng.uniform(24, 45)))
    radius = made.radius_px * float(rng.uniform(4, 7))
    return scene_of(
        made, "other body", picture(made, rng, others=(neighbour(made, radius, float(rng.uniform(4, 25)), rng),))
    )


def planet_behind(rng: np.random.Generator) -> Hostile:
    made = drawn(rng, radius_px=float(rng.uniform(24, 40)))
    radius = made.radius_px * float(rng.uniform(4, 7))
    gap = -made.radius_px * float(rng.uniform(0.5, 2.0))
    return scene_of(made, "other body", picture(made, rng, others=(neighbour(made, radius, gap, rng),)))


def moon_beside(rng: np.random.Generator) -> Hostile:
    """A second disk, of about the target's size and brighter."""
    made = drawn(rng, radius_px=float(rng.uniform(24, 40)))
    other = neighbour(made, made.radius_px * float(rng.uniform(0.8, 1.3)), float(rng.uniform(3, 20)), rng)
    return scene_of(made, "other body", picture(made, rng, others=(replace(other, albedo=1.8),)))


def neighbour(made: Drawn, radius_px: float, gap_px: float, rng: np.random.Generator) -> Body:
    """A body behind the target, its limb gap_px from the target's."""
    pose, away = made.truth, made.radius_px + radius_px + gap_px
    way = rng.uniform(0, 2 * np.pi)
    x, y = made.camera.project(pose.target_in_camera_km) + away * np.array([np.cos(way), np.sin(way)])
    range_km = 3 * pose.range_km
    sight = made.camera.ray((x, y)) @ pose.camera_from_j2000
    size_km = radius_px * range_km / made.camera.focal_length_px
    return Body(sight * range_km, np.full(3, size_km), np.eye(3), None, float(rng.uniform(0.7, 1.5)))


def cut_by_the_frame(rng: np.random.Generator) -> Hostile:
    """Less than a sixth of the disk is in the frame."""
    radius = float(rng.uniform(40, 70))
    made = drawn(
        rng, radius_px=radius, centre_px=(-radius * float(rng.uniform(0.7, 0.85)), float(rng.uniform(60, 140)))
    )
    return scene_of(made, "outside")


def limb_outside(rng: np.random.Generator) -> Hostile:
    """The lit limb is beyond the frame's edge; terminator and dark side are in it."""
    made = drawn(rng, phase_deg=80.0, radius_px=80.0)
    sun = made.truth.camera_from_j2000 @ made.truth.sun_from_target_km
    way = sun[:2] / np.hypot(*sun[:2])
    side = side_of(made)
    # From the middle, towards the Sun, until the lit limb has left the frame.
    room = min((side / 2) / max(abs(c), 1e-9) for c in way)
    off = np.degrees(way * (room - 20.0) / made.camera.focal_length_px)
    shift = rotation_from_vector_deg([-off[1], off[0], 0])
    centre = np.degrees(made.camera.project(made.truth.target_in_camera_km) - (side - 1) / 2)
    back = rotation_from_vector_deg(np.array([centre[1], -centre[0], 0]) / made.camera.focal_length_px)
    truth, given = (p.replaced(camera_from_j2000=shift @ back @ p.camera_from_j2000) for p in (made.truth, made.given))
    moved = replace(made, truth=truth, given=given)
    return scene_of(moved, "outside", picture(moved, rng))


def masked(rng: np.random.Generator) -> Hostile:
    """A mask covers the disk."""
    made = drawn(rng)
    x, y = made.camera.project(made.truth.target_in_camera_km)
    yy, xx = np.mgrid[: side_of(made), : side_of(made)]
    mask = np.hypot(xx - x, yy - y) < made.radius_px * float(rng.uniform(1.1, 1.4))
    return scene_of(made, "masked", truth=None, mask=mask)


def eclipsed(rng: np.random.Generator) -> Hostile:
    """Another body's shadow lies on the disk."""
    made = drawn(rng, phase_deg=float(rng.uniform(15, 60)))
    x, y = made.camera.project(made.truth.target_in_camera_km)
    sun = made.truth.camera_from_j2000 @ made.truth.sun_from_target_km
    way = np.arctan2(sun[1], sun[0]) + rng.uniform(-0.6, 0.6)
    yy, xx = np.mgrid[: side_of(made), : side_of(made)]
    reach = made.radius_px * float(rng.uniform(0.1, 0.5))
    depth = (xx - x) * np.cos(way) + (yy - y) * np.sin(way) - reach
    return scene_of(made, "shadow", 20 + (made.image - 20) / (1 + np.exp(np.clip(depth, -60, 60) / 1.5)))


def stray_light(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    yy, xx = np.mgrid[: side_of(made), : side_of(made)] / side_of(made)
    way = rng.uniform(0, 2 * np.pi)
    slope = np.cos(way) * xx + np.sin(way) * yy
    glow = float(rng.uniform(0.8, 2.5)) * made.image.max() * (slope - slope.min()) ** 2
    return scene_of(made, "stray light", made.image + glow)


def compressed(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    small = np.clip(255 * made.image / made.image.max(), 0, 255).astype(np.uint8)
    _, coded = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(1, 4))])
    return scene_of(made, "blocks", cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE).astype(np.float64))


def behind(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    turn = rotation_from_vector_deg([0, float(rng.uniform(120, 178)), 0])
    return scene_of(made, "behind", pose=made.given.replaced(camera_from_j2000=turn @ made.given.camera_from_j2000))


def too_small(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    return scene_of(made, "small", pose=made.given.with_range_factor(float(rng.uniform(25, 60))), truth=None)


def too_large(rng: np.random.Generator) -> Hostile:
    made = drawn(rng)
    factor = made.radius_px / (side_of(made) * float(rng.uniform(4, 9)))
    return scene_of(made, "large", pose=made.given.with_range_factor(factor), truth=None)


KINDS: tuple[Callable[[np.random.Generator], Hostile], ...] = (
    other_range,
    other_mode,
    other_camera,
    other_target,
    sun_turned,
    sun_of_another_time,
    mirrored,
    quarter_turned,
    negative,
    noise_only,
    outside,
    too_faint,
    clouded,
    map_of_another,
    another_face,
    saturated,
    limb_saturated,
    hot_pixels,
    missing_lines,
    zero_filled,
    truncated,
    blurred,
    smeared,
    planet_beside,
    planet_behind,
    moon_beside,
    cut_by_the_frame,
    limb_outside,
    masked,
    eclipsed,
    stray_light,
    compressed,
    behind,
    too_small,
    too_large,
)


def scenes(seed: int, each: int = 2, kinds: tuple[str, ...] = ()) -> Iterator[Hostile]:
    """`each` of every kind, or of those named; the same ones for the same seed."""
    for number in range(each):
        for place, kind in enumerate(KINDS):
            if not kinds or kind.__name__ in kinds:
                rng = np.random.default_rng([seed, place, number])
                yield replace(kind(rng), name=f"{kind.__name__}-{seed}-{number}")


def main(seed: int, kinds: tuple[str, ...], each: int = 2) -> int:
    """Print the table; 1 when less than nine in ten reasons name the cause."""
    counts: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    with tempfile.TemporaryDirectory() as place:
        for scene in scenes(seed, each, kinds):
            result = corrected(scene, Path(place))
            named, away = is_reported(scene, result), off_px(scene, result)
            kind = scene.name.partition("-")[0]
            counts[kind] = [counts[kind][0] + named, counts[kind][1] + 1]
            where = "" if away is None else f" [{away:.2f} px off]"
            print(f"{'yes' if named else 'NO '} {scene.name:26s} {scene.cause:11s} {scene.target:8s} "
                  f"{result['status']}{where} {(result['reason'] or '')[:260]}", flush=True)  # fmt: skip
    reported, count = (sum(column) for column in zip(*counts.values(), strict=True))
    for kind, (good, all_) in counts.items():
        print(f"{kind:22s} {good}/{all_}")
    print(f"{reported} of {count} reasons name the planted cause")
    return 0 if reported >= 0.9 * count else 1


__all__ = ["KINDS", "NAMED", "Drawn", "drawn", "scenes"]

if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), tuple(sys.argv[2:])))
