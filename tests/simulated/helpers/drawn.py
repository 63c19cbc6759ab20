"""Scenes drawn at random by a foreign ray caster: body, camera, size, phase, light and noise."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from hostile import Hostile, texture_of
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
