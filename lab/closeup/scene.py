"""Frames without a limb: where a camera of the catalog looks at a surface, and what its predicted pose gets wrong."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera, known_cameras
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target, known_targets
from lab.honesty.caster import View, render
from lab.honesty.solids import Solid
from tasks.point.rotation import smallest_turn
from tasks.project.points import body_points, pixels_of_points

Array = NDArray[np.float64]

TARGETS = ("europa", "io", "ganymede", "callisto", "pluto")
LAWS = {"lambert": {}, "lommel-seeliger": {}, "lunar-lambert": {}, "minnaert": {"k": 0.6}, "akimov": {}}
# Frames too narrow for patches are line scanners' in spirit, and no frames of 10 million pixels are rendered.
SMALLEST_PX, LARGEST_PIXELS = 280, 5.1e6
# Across the frame's diagonal, in radii of the body; angle of incidence in its middle; emission in its corners.
SPAN_RADII, INCIDENCE_DEG, LEAST_EMISSION_COSINE = (0.12, 1.0), (15.0, 75.0), 0.25
# Planted: pointing (logarithmic), roll, range.
OFFSET_PX, ROLL_DEG, RANGE_SHARE = (5.0, 150.0), 1.0, 0.003
SUN_KM = 7.4e8
BRIGHT_DN, SKY_DN, GAIN = 3000.0, 20.0, 4.0
RAYS_PER_MAP_PIXEL = 4
TRIES, TRIES_EACH = 1000, 50


@dataclass(frozen=True)
class CloseUp:
    """One frame: true and predicted pose, and what was planted."""

    seed: int
    camera: Camera
    target: Target
    law: str
    true: Pose
    predicted: Pose
    span_radii: float
    offset_px: float


def cameras() -> list[Camera]:
    """Cameras of the catalog whose frames can be close-ups."""
    found = [c for c in known_cameras().values() if min(c.size_px) >= SMALLEST_PX]
    return [c for c in found if c.size_px[0] * c.size_px[1] < LARGEST_PIXELS]


def close_up(seed: int) -> CloseUp:
    """The frame of a seed, the same each time."""
    random = np.random.default_rng([74, seed])
    target = known_targets()[TARGETS[int(random.integers(len(TARGETS)))]]
    span = float(np.exp(random.uniform(*np.log(SPAN_RADII))))
    every = cameras()
    for number in range(TRIES):
        # A wide-angle camera may see a limb whatever it looks at: then the next one has its turn.
        camera = every[(seed + number // TRIES_EACH) % len(every)]
        true = looking_at(random, camera, target, span)
        if true is not None:
            offset = float(np.exp(random.uniform(*np.log(OFFSET_PX))))
            law = list(LAWS)[int(random.integers(len(LAWS)))]
            return CloseUp(
                seed, camera, target, law, true, mistaken(random, true, camera, target, offset), span, offset
            )
    raise ValueError(f"no frame without a limb in {TRIES} tries")


def looking_at(random: np.random.Generator, camera: Camera, target: Target, span: float) -> Pose | None:
    """A pose whose frame is `span` radii across and shows nothing but lit surface; None where the draw does not."""
    radius = target.mean_radius_km
    distance = span * radius / float(np.hypot(*camera.size_px)) * camera.focal_length_px
    above = unit(random)
    place = toward(random, above, float(random.uniform(0.0, 60.0)))
    sun = toward(random, place, float(random.uniform(*INCIDENCE_DEG)))
    # From the place, at `distance` towards where it is seen from: `above` gives the direction.
    spacecraft = place * radius + distance * above
    boresight = -above
    camera_from_j2000 = smallest_turn(boresight, np.array([0.0, 0.0, 1.0]))
    roll = rotation_from_vector_deg([0.0, 0.0, float(random.uniform(0, 360))])
    pose = Pose(2.0e8, roll @ camera_from_j2000, -spacecraft, sun * SUN_KM, rotation_from_vector_deg(unit(random) * 90))
    nx, ny = camera.size_px
    points = body_points(pose, camera, target, [(0, 0), (nx - 1, 0), (0, ny - 1), (nx - 1, ny - 1)])
    if not np.isfinite(points).all():
        return None
    normal = points / np.square(target.radii_km)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    sight = pose.spacecraft_in_body_km - points
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    steep = (normal * sight).sum(axis=1).min() > LEAST_EMISSION_COSINE
    return pose if steep and (normal @ pose.sun_direction_in_body).min() > 0.05 else None


def unit(random: np.random.Generator) -> Array:
    """A direction (3,)."""
    vector = random.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def toward(random: np.random.Generator, axis: Array, angle_deg: float) -> Array:
    """A direction (3,) at an angle from `axis`."""
    side = np.cross(axis, unit(random))
    angle = np.radians(angle_deg)
    return np.asarray(np.cos(angle) * axis + np.sin(angle) * side / np.linalg.norm(side))


def mistaken(random: np.random.Generator, true: Pose, camera: Camera, target: Target, offset_px: float) -> Pose:
    """What metadata with errors of pointing, roll and range say."""
    middle = np.asarray(camera.centre_px)
    point = body_points(true, camera, target, middle)
    farther = true.with_range_factor(1 + float(random.uniform(-RANGE_SHARE, RANGE_SHARE)))
    direction = float(random.uniform(0, 2 * np.pi))
    there = middle + offset_px * np.array([np.cos(direction), np.sin(direction)])
    turn = smallest_turn(camera.ray(pixels_of_points(farther, camera, point)), camera.ray(there))
    roll = rotation_from_vector_deg([0.0, 0.0, float(random.uniform(-ROLL_DEG, ROLL_DEG))])
    return farther.replaced(camera_from_j2000=roll @ turn @ true.camera_from_j2000)


def pixel_km(scene: CloseUp) -> float:
    """Kilometres per pixel in the middle of the frame."""
    point = body_points(scene.true, scene.camera, scene.target, scene.camera.centre_px)
    away = np.linalg.norm(point - scene.true.spacecraft_in_body_km)
    return float(away / scene.camera.focal_length_px)


def photographed(scene: CloseUp, texture: NDArray[np.float32]) -> Observation:
    """The frame as its camera takes it of a surface, with blur and noise."""
    import cv2

    (nx, ny), true, camera = scene.camera.size_px, scene.true, scene.camera
    solid = Solid(
        true.target_from_spacecraft_km,
        np.asarray(scene.target.radii_km, np.float64),
        true.body_from_j2000,
        scene.law,
        LAWS[scene.law],
        texture,
    )
    # A pixel of the map is many pixels of such a frame: a ray for each quarter of it, and between them a cubic.
    step = max(1, int(np.pi * scene.target.mean_radius_km / len(texture) / pixel_km(scene) / RAYS_PER_MAP_PIXEL))
    centre = (camera.centre_px[0] / step, camera.centre_px[1] / step)
    columns, rows = (-(-size // step) + 1 for size in (nx, ny))
    view = View(true.camera_from_j2000, camera.focal_length_px / step, centre, 0, 0, columns, rows, 1)
    light = render(view, [solid], true.sun_from_target_km)
    x, y = np.meshgrid(np.arange(nx, dtype=np.float32) / step, np.arange(ny, dtype=np.float32) / step)
    light = np.maximum(cv2.remap(light, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), 0)
    light = cv2.GaussianBlur(light, (0, 0), max(camera.psf_sigma_px, 0.5))
    random = np.random.default_rng([75, scene.seed])
    read = float(random.uniform(5.0, 30.0))
    counts = random.poisson(light / max(float(light.max()), 1e-9) * BRIGHT_DN * GAIN) / GAIN
    image = (counts + random.normal(SKY_DN, read, light.shape)).astype(np.float32)
    noise = np.sqrt(np.maximum(image, 0) / GAIN + read**2).astype(np.float32)
    return Observation(image, noise, np.zeros(image.shape, np.uint16))
