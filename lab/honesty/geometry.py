"""True and predicted geometry of a scene, in plain vectors; nothing of the estimator's."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from catalog.target import find_target
from lab.honesty.scene import (
    ATTITUDE_SIGMA_DEG,
    CUT_SIGMAS,
    FOCAL_SIGMA,
    GOOD_ATTITUDE_SIGMA_DEG,
    GOOD_RANGE_SIGMA,
    LENSES,
    MASTER_SEED,
    RANGE_SIGMA,
    ROLL_SIGMA_DEG,
    Scene,
)

Array = NDArray[np.float64]
ET = 2.0e8
SUN_KM = 7.4e8
KEYS = ("camera_from_j2000", "target_from_spacecraft_km", "sun_from_target_km", "body_from_j2000")


@dataclass(frozen=True)
class Geometry:
    """As a `Pose`: rotations (3, 3), vectors (3,) in km, J2000; and the camera's focal length and optical centre."""

    camera_from_j2000: Array
    target_from_spacecraft_km: Array
    sun_from_target_km: Array
    body_from_j2000: Array
    focal_px: float
    centre_px: tuple[float, float]

    def place_px(self) -> Array:
        """(x, y) of the target's centre in the picture."""
        v = self.camera_from_j2000 @ self.target_from_spacecraft_km
        return np.asarray(v[:2] / v[2] * self.focal_px + np.asarray(self.centre_px))

    def pose(self) -> dict[str, Any]:
        """Content of a pose file."""
        return {"et": ET, **{key: getattr(self, key).tolist() for key in KEYS}}


def random_of(scene: Scene, purpose: int) -> np.random.Generator:
    """Random numbers of a scene for one purpose; others do not move when one draws more."""
    return np.random.default_rng([MASTER_SEED, scene.seed, purpose])


def turn(axis: Array, angle_deg: float) -> Array:
    """Rotation (3, 3) about `axis` (any length) by the right hand."""
    return np.asarray(Rotation.from_rotvec(np.radians(angle_deg) * axis / np.linalg.norm(axis)).as_matrix())


def true_geometry(scene: Scene) -> Geometry:
    """Geometry of the exposure, before the picture is mirrored or turned."""
    random = random_of(scene, 0)
    lens, side = LENSES[scene.lens], scene.frame_px
    middle = (side - 1) / 2
    camera = np.asarray(Rotation.random(random_state=np.random.RandomState(scene.seed)).as_matrix())
    body = np.asarray(Rotation.random(random_state=np.random.RandomState(scene.seed + 10_000)).as_matrix())
    room = max(side / 2 - 1.15 * scene.radius_px, 0.0)
    drawn = middle + random.uniform(-0.6, 0.6, 2) * room
    centre = drawn if scene.centre is None else np.asarray(scene.centre) * side
    radius_km = find_target(scene.target).mean_radius_km
    range_km = radius_km * np.hypot(1.0, lens.focal_px / scene.radius_px)
    sight = np.array([(centre[0] - middle) / lens.focal_px, (centre[1] - middle) / lens.focal_px, 1.0])
    sight /= np.linalg.norm(sight)
    angle = random.uniform(0, 2 * np.pi)
    across = np.array([np.cos(angle), np.sin(angle), 0.0])
    across -= sight * (across @ sight)
    phase = np.radians(scene.phase_deg)
    sun = -np.cos(phase) * sight + np.sin(phase) * across / np.linalg.norm(across)
    return Geometry(camera, camera.T @ sight * range_km, camera.T @ sun * SUN_KM, body, lens.focal_px, (middle, middle))


def seen_geometry(scene: Scene, true: Geometry) -> Geometry:
    """The geometry that a correction of the file's picture should find: the true one, its camera turned with the
    picture. A mirrored picture has none; the target's centre is where the picture has it, the rest the true one."""
    if scene.picture == "turned-180":
        return replace(true, camera_from_j2000=np.diag([-1.0, -1.0, 1.0]) @ true.camera_from_j2000)
    if scene.picture == "turned-90":  # np.rot90: the column x = c goes to the row y = -c
        quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        return replace(true, camera_from_j2000=quarter @ true.camera_from_j2000)
    return true


def seen_place_px(scene: Scene, true: Geometry) -> Array:
    """(x, y) of the target's centre in the file's picture."""
    place = seen_geometry(scene, true).place_px()
    axis = {"mirrored-x": 0, "mirrored-y": 1}.get(scene.picture)
    if axis is not None:
        place[axis] = scene.frame_px - 1 - place[axis]
    return place


def cut_normal(random: np.random.Generator, sigma: float, size: int | None = None) -> Any:
    """Normal errors, those beyond CUT_SIGMAS drawn again."""
    values = np.atleast_1d(random.normal(size=size or 1))
    while (beyond := np.abs(values) > CUT_SIGMAS).any():
        values[beyond] = random.normal(size=int(beyond.sum()))
    return sigma * values if size else sigma * float(values[0])


def planted_errors(scene: Scene) -> dict[str, Any]:
    """What the metadata get wrong: offset_px (2,) and roll_deg of the camera, range_factor, attitude_deg (3,) rotation
    vector of the body in its frame, sun_off_deg, focal_error (that of every camera file beside the scene's own). Range
    and attitude are drawn from what a pose file is assumed to be good for, or a kernel; an offset of 5-40 px has any
    direction."""
    random = random_of(scene, 1)
    good = scene.metadata == "good"
    range_sigma = GOOD_RANGE_SIGMA if good else RANGE_SIGMA
    length, angle = random.uniform(5, 40), random.uniform(0, 2 * np.pi)
    attitude = cut_normal(random, GOOD_ATTITUDE_SIGMA_DEG if good else ATTITUDE_SIGMA_DEG, 3)
    if scene.orientation_deg is not None:
        axis = random.normal(size=3)
        attitude = axis / np.linalg.norm(axis) * scene.orientation_deg
    attitude = attitude + np.array([0.0, 0.0, scene.late_deg])
    return {
        "offset_px": [length * np.cos(angle), length * np.sin(angle)],
        "roll_deg": cut_normal(random, ROLL_SIGMA_DEG),
        "range_factor": 1 + cut_normal(random, range_sigma),
        "attitude_deg": [float(a) for a in attitude],
        "sun_off_deg": scene.sun_off_deg,
        "focal_error": scene.focal_error + FOCAL_SIGMA * float(random_of(scene, 7).normal()),
    }


def predicted_geometry(scene: Scene, true: Geometry, errors: dict[str, Any]) -> Geometry:
    """What the metadata say. Of a wrong target the range is such that its disk has the size that is seen, unless the
    true range is stated."""
    random = random_of(scene, 2)
    dx, dy = errors["offset_px"]
    sight = true.camera_from_j2000 @ true.target_from_spacecraft_km
    x, y = sight[0] / sight[2] + dx / true.focal_px, sight[1] / sight[2] + dy / true.focal_px
    moved = np.array([x, y, 1.0])
    axis = np.cross(sight, moved)
    angle = np.degrees(np.arctan2(np.linalg.norm(axis), sight @ moved))
    camera = turn(moved, errors["roll_deg"]) @ turn(axis, float(angle)) @ true.camera_from_j2000
    factor = errors["range_factor"]
    if scene.reported is not None and not scene.same_range:
        factor *= find_target(scene.reported).mean_radius_km / find_target(scene.target).mean_radius_km
    attitude = np.asarray(errors["attitude_deg"])
    size = float(np.linalg.norm(attitude))
    body = turn(attitude, size) @ true.body_from_j2000 if size else true.body_from_j2000
    sun = true.sun_from_target_km
    if scene.sun_off_deg:
        sun = turn(np.cross(sun, random.normal(size=3)), scene.sun_off_deg) @ sun
    return replace(
        true,
        camera_from_j2000=camera,
        target_from_spacecraft_km=true.target_from_spacecraft_km * factor,
        sun_from_target_km=sun,
        body_from_j2000=body,
        focal_px=true.focal_px * (1 + errors["focal_error"]),
    )
