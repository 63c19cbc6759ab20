"""Scenes that cannot be corrected, each with one planted cause, and the reasons that the program gives.

Run it for the whole table: python tests/simulated/helpers/hostile.py [NAME ...]
"""

import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from astropy.io import fits
from ray_caster import Body, blotches, body_at, exposed, pose_of, rendered

from catalog.basemap import map_of_target
from catalog.camera import Camera
from catalog.pose import Pose, write_pose_file
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from flows.one_image import one_result
from flows.progress import Silent
from flows.request import Request
from tasks.step import run as run_step

FOCAL_PX, SIDE = 100_000.0, 256
CAMERA = Camera(name="hostile", size_px=(SIDE, SIDE), centre_px=(127.5, 127.5), focal_length_px=FOCAL_PX)
# A reason names the cause when its first sentence has one of these; a solved image names it by being right.
NAMED = {
    "size": r"disk in the image is [\d.]+ times as wide as predicted.*range.*focal length.*target|disk-size",
    "mode": r"summing-mode|disk-size: .*summing mode",
    "sun": r"direction of the Sun",
    "mirrored": r"mirrored",
    "turned": r"turned|direction of the Sun",
    "negative": r"negative",
    "map": r"markings|base map|map-does-not-match",
    "saturated": r"saturated",
    "empty": r"nothing in the frame looks like|target-not-found",
    "outside": r"edge of the frame|nothing in the frame looks like|would be in the frame|target-not-found|nowhere on",
    "behind": r"behind the camera",
    "small": r"disk-too-small|only [\d.]+ px wide",
    "large": r"no-limb",
    "other body": r"another bright body|another body",
    "lines": r"pixels are missing|on missing or flagged pixels",
    "specks": r"$^",
    "blur": r"blurred|smeared",
    "faint": r"faint|nothing in the frame looks like",
    "masked": r"mask",
    "shadow": r"shadow",
    "stray light": r"stray light",
    "blocks": r"blocks|compress",
}


@dataclass(frozen=True)
class Hostile:
    """image (ny, nx), the pose file's pose and the camera file's camera; cause: a key of NAMED. truth: of the picture,
    None where there is nothing to be right about. mask: (ny, nx), given with --mask."""

    name: str
    cause: str
    image: np.ndarray
    pose: Pose
    camera: Camera = CAMERA
    target: str = "europa"
    truth: Pose | None = None
    mask: np.ndarray | None = None


def wrong(pose: Pose, offset_px: tuple[float, float] = (9.0, -6.0), factor: float = 1.002) -> Pose:
    """A pose as metadata have it: some pixels, 0.2 % of the range and some tenths of a degree off."""
    turn = rotation_from_vector_deg(np.degrees([-offset_px[1] / FOCAL_PX, offset_px[0] / FOCAL_PX, 0]))
    body = rotation_from_vector_deg([0.2, -0.15, 0.1])
    moved = pose.replaced(camera_from_j2000=turn @ pose.camera_from_j2000, body_from_j2000=body @ pose.body_from_j2000)
    return moved.with_range_factor(factor)


def texture_of(target: str) -> np.ndarray:
    """The catalog's map."""
    found = map_of_target(find_target(target))
    columns = found.albedo.shape[1]
    return np.roll(found.albedo, round(found.left_edge_deg / 360 * columns), axis=1)


VIEWS: list[dict[str, Any]] = [
    {"above_deg": (250, 5), "sun_deg": (290, 3), "roll_deg": 20},
    {"above_deg": (80, -12), "sun_deg": (20, 5), "roll_deg": 200},
    {"above_deg": (160, 20), "sun_deg": (240, -10), "roll_deg": 110},
]


def usual(view: int = 0, radius_px: float = 50.0, target: str = "europa", **other: Any) -> tuple[Pose, np.ndarray]:
    """A pose and its picture."""
    body = find_target(target)
    chosen = {"centre_px": (120.0, 133.0)} | VIEWS[view % 3] | other
    pose = pose_of(CAMERA, body.mean_radius_km, radius_px, **chosen)
    return pose, exposed(rendered(pose, CAMERA, [body_at(pose, body.radii_km, texture_of(target))]), view)


def scenes(views: tuple[int, ...] = (0, 1, 2)) -> Iterator[Hostile]:
    """All of them, for each of the views."""
    rng = np.random.default_rng(5)
    for view in views:
        pose, image = usual(view)
        given = wrong(pose)
        yield from sizes(view, image, given)
        yield from poses(view, image, given, pose)
        yield from pictures(view, image, given, pose, rng)
        yield from bodies(view, given)


def sizes(view: int, image: np.ndarray, given: Pose) -> Iterator[Hostile]:
    """The disk is not as large as predicted."""
    for factor in (0.8, 1.2):
        yield Hostile(f"range-{factor}-{view}", "size", image, given.with_range_factor(factor))
    for factor in (0.5, 2.0):
        camera = CAMERA.model_copy(update={"focal_length_px": FOCAL_PX * factor})
        yield Hostile(f"focal-{factor}-{view}", "mode", image, given, camera)
    yield Hostile(f"target-io-{view}", "size", image, given, target="io")
    yield Hostile(f"tiny-{view}", "small", image, given.with_range_factor(20.0))


def poses(view: int, image: np.ndarray, given: Pose, truth: Pose) -> Iterator[Hostile]:
    """The pose is wrong in another way."""
    for turn_deg in (80.0, -120.0):
        sight = given.target_from_spacecraft_km / given.range_km
        sun = rotation_from_vector_deg(turn_deg * sight) @ given.sun_from_target_km
        yield Hostile(f"sun-{turn_deg:.0f}-{view}", "sun", image, given.replaced(sun_from_target_km=sun))
    away = rotation_from_vector_deg([0, 175, 0]) @ given.camera_from_j2000
    yield Hostile(f"behind-{view}", "behind", image, given.replaced(camera_from_j2000=away), truth=truth)
    rolled = rotation_from_vector_deg([0, 0, 180]) @ given.camera_from_j2000
    yield Hostile(f"turned-{view}", "turned", image, given.replaced(camera_from_j2000=rolled))


def pictures(view: int, image: np.ndarray, given: Pose, truth: Pose, rng: np.random.Generator) -> Iterator[Hostile]:
    """The picture is spoilt."""
    yield Hostile(f"mirrored-{view}", "mirrored", image[:, ::-1].copy(), given)
    yield Hostile(f"negative-{view}", "negative", 2600 - image, given)
    yield Hostile(f"noise-{view}", "empty", rng.normal(20, 6, image.shape), given)
    plate = np.minimum(image, 500.0) if view else np.minimum(image, 300.0)
    yield Hostile(f"saturated-{view}", "saturated", np.round(plate), given)
    hot = np.round(np.clip(20 + (image - 20) * 0.3, 0, 4095))
    hot[rng.integers(0, SIDE, 60), rng.integers(0, SIDE, 60)] = 4095
    yield Hostile(f"hot-{view}", "specks", hot, given, truth=truth)
    cut = image.copy()
    cut[100:] = np.nan
    yield Hostile(f"truncated-{view}", "lines", cut, given, truth=truth)


def bodies(view: int, given: Pose) -> Iterator[Hostile]:
    """What is in the frame is not the target as the map has it."""
    body = find_target("europa")
    outside = pose_of(CAMERA, body.mean_radius_km, 50.0, (-95.0, 120.0), **VIEWS[view])
    yield Hostile(f"outside-{view}", "outside", exposed(rendered(outside, CAMERA, []) + 0.0, view), given)
    pose = pose_of(CAMERA, body.mean_radius_km, 50.0, (120.0, 133.0), **VIEWS[view])
    clouded = body_at(pose, body.radii_km, blotches(view + 3, 0.5))
    yield Hostile(f"clouds-{view}", "map", exposed(rendered(pose, CAMERA, [clouded]), view), given, truth=pose)
    blurred = cv2.GaussianBlur(rendered(pose, CAMERA, [body_at(pose, body.radii_km, texture_of("europa"))]), (0, 0), 8)
    yield Hostile(f"blur-{view}", "blur", exposed(blurred, view), given, truth=pose)
    yield Hostile(
        f"planet-{view}", "other body", exposed(rendered(pose, CAMERA, beside(pose)), view), given, truth=pose
    )


def beside(pose: Pose, gap_px: float = 8.0, planet_px: float = 220.0) -> list[Body]:
    """The target, and a bright planet far behind it whose limb is `gap_px` from the target's."""
    body = find_target("europa")
    range_km, radius_km = 3 * pose.range_km, planet_px * 3 * pose.range_km / FOCAL_PX
    radius_px = FOCAL_PX * body.mean_radius_km / pose.range_km
    shift = rotation_from_vector_deg([0, np.degrees(-(planet_px + radius_px + gap_px) / FOCAL_PX), 0])
    sight = shift @ (pose.target_in_camera_km / pose.range_km)
    planet = Body(pose.camera_from_j2000.T @ sight * range_km, np.full(3, radius_km), np.eye(3), None, 1.3)
    return [body_at(pose, body.radii_km, texture_of("europa")), planet]


def corrected(scene: Hostile, folder: Path, **requested: Any) -> dict[str, Any]:
    """The program's result."""
    folder.mkdir(parents=True, exist_ok=True)
    fits.writeto(folder / f"{scene.name}.fits", scene.image.astype(np.float32), overwrite=True)
    write_pose_file(scene.pose, folder / f"{scene.name}.json")
    camera = folder / f"{scene.name}.toml"
    (nx, ny), (x, y) = scene.camera.size_px, scene.camera.centre_px
    if scene.mask is not None:
        requested["mask"] = folder / f"{scene.name}.mask.fits"
        fits.writeto(requested["mask"], scene.mask.astype(np.uint8), overwrite=True)
    camera.write_text(
        f'name = "hostile"\nsize_px = [{nx}, {ny}]\ncentre_px = [{x}, {y}]\n'
        f"focal_length_px = {scene.camera.focal_length_px}\n"
    )
    request = Request(
        image=folder / f"{scene.name}.fits",
        product=scene.name,
        camera=str(camera),
        target=scene.target,
        pose_file=folder / f"{scene.name}.json",
        store=folder / "out",
        cache=folder / "cache",
        kernels=(),
        **requested,
    )
    return one_result(request, Silent(), run_step=run_step)


def off_px(scene: Hostile, result: dict[str, Any]) -> float | None:
    """Pixels between the found centre and the true one."""
    if scene.truth is None or result["centre_px"] is None:
        return None
    true = scene.camera.project(scene.truth.target_in_camera_km)
    return float(np.hypot(*(np.array(result["centre_px"]) - true)))


def is_reported(scene: Hostile, result: dict[str, Any]) -> bool:
    """Whether the first sentence names the planted cause, or the image is solved all the same, to half a pixel."""
    away = off_px(scene, result)
    if result["status"] in ("ok", "doubtful") and away is not None and away < 0.5:
        return True
    first = re.split(r"\.\s", result["reason"] or "")[0]
    return result["status"] != "ok" and re.search(NAMED[scene.cause], first) is not None


def main(names: list[str], ask: Callable[[Hostile], dict[str, Any]] | None = None) -> int:
    """Print the table; 1 when less than nine in ten reasons name the cause."""
    reported, count = 0, 0
    with tempfile.TemporaryDirectory() as place:
        for scene in scenes():
            if names and not any(name in scene.name for name in names):
                continue
            started = time.process_time()
            result = ask(scene) if ask else corrected(scene, Path(place))
            named, away = is_reported(scene, result), off_px(scene, result)
            reported, count = reported + named, count + 1
            where = "" if away is None else f" [{away:.2f} px off]"
            seconds = time.process_time() - started
            reason = (result["reason"] or "")[:150]
            print(f"{'yes' if named else 'NO '} {scene.name:16s} {scene.cause:10s} {seconds:4.0f} s "
                  f"{result['status']}{where} {reason}", flush=True)  # fmt: skip
    print(f"{reported} of {count} reasons name the planted cause")
    return 0 if reported >= 0.9 * count else 1


__all__ = ["Hostile", "corrected", "is_reported", "main", "off_px", "scenes"]

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
