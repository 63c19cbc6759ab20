"""Directions of the Sun as a picture shows them: phase angle, and azimuth in the picture."""

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose


def axes_of(pose: Pose) -> NDArray[np.float64]:
    """Rows: rightward and downward in the picture at the target, and towards the target; unit vectors of the camera's
    frame."""
    sight = pose.target_in_camera_km / pose.range_km
    right = np.array([1.0, 0.0, 0.0]) - sight[0] * sight
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(sight, right), sight])


def sun_azimuth_deg(pose: Pose) -> float:
    """Where the light comes from in the picture, 0-360 from +x towards +y."""
    right, down, _ = axes_of(pose)
    sun = pose.camera_from_j2000 @ pose.sun_from_target_km
    return float(np.degrees(np.arctan2(down @ sun, right @ sun)) % 360)


def with_sun(pose: Pose, azimuth_deg: float, phase_deg: float) -> Pose:
    """The pose with the Sun there, as far away as before."""
    right, down, sight = axes_of(pose)
    azimuth, phase = np.radians([azimuth_deg, phase_deg])
    sun = np.sin(phase) * (np.cos(azimuth) * right + np.sin(azimuth) * down) - np.cos(phase) * sight
    distance = np.linalg.norm(pose.sun_from_target_km)
    return pose.replaced(sun_from_target_km=pose.camera_from_j2000.T @ sun * distance)


def with_sun_moved(pose: Pose, azimuth_deg: float, phase_deg: float) -> Pose:
    """Pose whose Sun is turned about the line of sight, from +x towards +y of the image, and away from the
    spacecraft's direction."""
    return with_sun(pose, sun_azimuth_deg(pose) + azimuth_deg, pose.phase_deg + phase_deg)
