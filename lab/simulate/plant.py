"""Planting errors in a true pose, and measuring what is left of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target
from tasks.point.rotation import pose_moved_by
from tasks.project.points import pixels_of_points, surface_points, visible


def planted(truth: Pose, camera: Camera, offset_px: ArrayLike, range_factor: float, attitude_deg: ArrayLike) -> Pose:
    """The wrong pose that a correction by exactly these amounts turns into `truth`.

    offset_px: true minus predicted centre (2,), undistorted pixels. range_factor: true over predicted range.
    attitude_deg: rotation vector (3,), body-fixed axes, that turns the predicted body into the true one.
    """
    farther = truth.with_range_factor(1 / range_factor)
    turned = farther.replaced(body_from_j2000=rotation_from_vector_deg(attitude_deg) @ farther.body_from_j2000)
    return pose_moved_by(turned, camera, -np.asarray(offset_px, dtype=np.float64))


@dataclass(frozen=True)
class PoseError:
    """A pose minus the truth. centre_px: the target's centre (dx, dy). range: relative. attitude_deg: angle between the
    body's attitudes in the camera frame. surface_px: RMS distance between the places of visible surface points."""

    centre_px: tuple[float, float]
    range: float
    attitude_deg: float
    surface_px: float


def pose_error(pose: Pose, truth: Pose, camera: Camera, target: Target) -> PoseError:
    """How far `pose` is from `truth`."""
    dx, dy = camera.project(pose.target_in_camera_km) - camera.project(truth.target_in_camera_km)
    turn = pose.camera_from_body @ truth.camera_from_body.T
    angle_rad = 2 * np.arcsin(np.clip(np.linalg.norm(turn - np.eye(3)) / np.sqrt(8), 0, 1))
    return PoseError(
        centre_px=(float(dx), float(dy)),
        range=pose.range_km / truth.range_km - 1,
        attitude_deg=float(np.degrees(angle_rad)),
        surface_px=_surface_error_px(pose, truth, camera, target),
    )


def _surface_error_px(pose: Pose, truth: Pose, camera: Camera, target: Target) -> float:
    latitude, longitude = np.meshgrid(np.arange(-87.5, 90, 5), np.arange(0, 360, 5))
    points = surface_points(target, latitude, longitude)
    seen = visible(truth, target, points)
    weight = np.cos(np.radians(latitude[seen]))
    apart = pixels_of_points(pose, camera, points[seen]) - pixels_of_points(truth, camera, points[seen])
    return float(np.sqrt(np.average((apart**2).sum(axis=-1), weights=weight)))
