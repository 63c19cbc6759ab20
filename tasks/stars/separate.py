"""What of an image's correction is the camera's, and what the target's: with the camera's orientation by stars, where
the target is seen says where it is, apart from its ephemeris and the spacecraft's trajectory."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import vector_deg_from_rotation
from tasks.priors import PriorSettings

Array = NDArray[np.float64]
Json = dict[str, Any]
# A roll by stars is held no tighter than this: what is left of distortion is not that much better known.
LEAST_ROLL_DEG = 1e-3
TOGETHER = (
    "an error of the camera's orientation and one of the target's direction look the same in the image and cannot be "
    "separated"
)


@dataclass(frozen=True)
class StarOrientation:
    """camera_from_j2000 (3, 3) by stars; covariance_deg2 (3, 3) of small rotations about the camera's axes."""

    camera_from_j2000: Array
    covariance_deg2: Array

    def predicted(self, pose: Pose) -> Pose:
        """The predicted pose as this orientation has it: the target where trajectory and ephemeris say."""
        return pose.replaced(camera_from_j2000=self.camera_from_j2000)

    def priors(self, given: PriorSettings) -> PriorSettings:
        """Priors of that pose: the camera's roll is known as well as by stars."""
        roll_deg = float(np.sqrt(self.covariance_deg2[2, 2]))
        return given.model_copy(update={"roll_deg": max(roll_deg, LEAST_ROLL_DEG)})

    def separated(self, pose: Pose, predicted: Pose) -> Pose:
        """The corrected pose with the camera as the stars have it and the target in place of the camera moved: each
        pixel sees what it saw. A body whose orientation the image did not change keeps it in J2000 as well, so that it
        is seen from a direction that is new by as much as the target is elsewhere."""
        turn = self.camera_from_j2000.T @ pose.camera_from_j2000
        kept = np.array_equal(pose.body_from_j2000, predicted.body_from_j2000)
        return pose.replaced(
            camera_from_j2000=self.camera_from_j2000,
            target_from_spacecraft_km=turn @ pose.target_from_spacecraft_km,
            body_from_j2000=pose.body_from_j2000 if kept else pose.body_from_j2000 @ turn.T,
        )


def orientation_stated(stars: Mapping[str, Any]) -> StarOrientation | None:
    """The camera's orientation by what a record or a product says of stars; None without a lock."""
    if not stars.get("stars"):
        return None
    return StarOrientation(np.array(stars["camera_from_j2000"]), np.array(stars["uncertainty"]["covariance_deg2"]))


def separation(
    stars: StarOrientation, metadata: Pose, predicted: Pose, after: Pose, camera: Camera, sigma: Mapping[str, Any]
) -> Json:
    """How far the camera was turned from the metadata's orientation, and how far the target is from where its
    trajectory and ephemeris have it.

    metadata: the predicted pose; predicted: the same with the stars' camera; after: the corrected one. sigma: 1-sigma
    `offset_px` and `range_factor` of the image's correction; None where unknown."""
    turn = vector_deg_from_rotation(stars.camera_from_j2000 @ metadata.camera_from_j2000.T)
    before = camera.project(stars.camera_from_j2000 @ metadata.camera_from_j2000[2])
    centre, was = (camera.project(pose.target_in_camera_km) for pose in (after, predicted))
    covariance = offset_covariance_km2(stars, after, camera, sigma)
    by_stars_px = np.sqrt(np.diag(orientation_covariance_px2(stars, after.target_in_camera_km, camera)))
    own_px = np.array(sigma["offset_px"] if sigma.get("offset_px") is not None else [np.nan, np.nan], dtype=float)
    return {
        "camera_offset_px": _plain(before - np.asarray(camera.centre_px)),
        "camera_roll_deg": float(turn[2]),
        "target_offset_px": _plain(centre - was),
        "target_offset_sigma_px": _plain(np.hypot(own_px, by_stars_px)),
        "target_offset_km": _plain(after.target_from_spacecraft_km - predicted.target_from_spacecraft_km),
        "target_offset_covariance_km2": None if covariance is None else covariance.tolist(),
    }


def offset_covariance_km2(stars: StarOrientation, pose: Pose, camera: Camera, sigma: Mapping[str, Any]) -> Array | None:
    """Covariance (3, 3), J2000, of where the target is seen: of its place in the picture, its distance, and the
    orientation by stars. None where the error of its place is not known."""
    if sigma.get("offset_px") is None:
        return None
    seen, distance = pose.target_in_camera_km, pose.range_km
    along = seen / distance
    across = np.eye(3) - np.outer(along, along)
    # A pixel is that much across the line of sight.
    place = across @ np.diag([*(np.array(sigma["offset_px"]) * seen[2] / camera.focal_length_px) ** 2, 0.0]) @ across.T
    share = sigma.get("range_factor")
    length = np.outer(along, along) * (distance * (float(share) if share is not None else 0.0)) ** 2
    turned = _cross(seen) @ (np.radians(1.0) ** 2 * stars.covariance_deg2) @ _cross(seen).T
    to_j2000 = stars.camera_from_j2000.T
    return np.asarray(to_j2000 @ (place + length + turned) @ to_j2000.T)


def orientation_covariance_px2(stars: StarOrientation, seen_km: Array, camera: Camera) -> Array:
    """Covariance (2, 2) of where the orientation by stars puts a direction (3,) of the camera's frame."""
    x, y, z = seen_km
    by_place = camera.focal_length_px / z * np.array([[1.0, 0.0, -x / z], [0.0, 1.0, -y / z]])
    slope = by_place @ -_cross(seen_km)
    return np.asarray(slope @ (np.radians(1.0) ** 2 * stars.covariance_deg2) @ slope.T)


def _cross(v: Array) -> Array:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def _plain(values: Array) -> list[float | None]:
    return [float(each) if np.isfinite(each) else None for each in values]
