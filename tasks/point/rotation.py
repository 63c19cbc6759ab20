"""From an offset in the image to a rotation of the camera (paper, section 3.1.2)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.pose import Pose

MAX_NEWTON_STEPS = 20
TOLERANCE_PX = 1e-9
# Beyond this a turn is no longer the same as an offset in the picture, whichever axis it is begun with.
LARGEST_OFFSET_DEG = 10.0


def euler_rotation(alpha_rad: float, beta_rad: float) -> NDArray[np.float64]:
    """M_o (3, 3): rotation by alpha about x, then by beta about y; none about the boresight."""
    ca, sa, cb, sb = np.cos(alpha_rad), np.sin(alpha_rad), np.cos(beta_rad), np.sin(beta_rad)
    about_x = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    about_y = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    return about_y @ about_x


def angles_from_offset(camera: Camera, offset_px: ArrayLike) -> tuple[float, float]:
    """alpha = arctan(-b_y / b_z) and beta = arctan(b_x / b_z), radians, of b = K^-1 [c + offset] (paper, eq. 9 and
    the text below it)."""
    b = camera.ray(np.asarray(camera.centre_px) + np.asarray(offset_px))
    return float(np.arctan2(-b[1], b[2])), float(np.arctan2(b[0], b[2]))


def pose_moved_by(pose: Pose, camera: Camera, offset_px: ArrayLike) -> Pose:
    """Pose whose camera is turned (no roll) so that the target's centre falls `offset_px` (2,) away from before.

    The paper's angles are exact for a target on the boresight; Newton steps make them exact for any place in the frame.
    Raises ValueError when the target is behind the camera.
    """
    before = camera.project(pose.target_in_camera_km)
    wanted = before + np.asarray(offset_px, dtype=np.float64)
    if not np.isfinite(wanted).all():
        raise ValueError("the target is behind the camera, or the offset is not finite")
    angles = np.array(angles_from_offset(camera, offset_px))
    for _ in range(MAX_NEWTON_STEPS):
        turned = euler_rotation(*angles) @ pose.target_in_camera_km
        miss = wanted - camera.project(turned)
        if np.abs(miss).max() < TOLERANCE_PX:
            break
        angles += np.array([-miss[1], miss[0]]) / camera.focal_length_px
    return pose.replaced(camera_from_j2000=euler_rotation(*angles) @ pose.camera_from_j2000)


def pose_pointed_at(pose: Pose, camera: Camera, xy_px: ArrayLike) -> Pose:
    """Pose whose camera is turned by the smallest rotation that puts the target's centre at pixel `xy_px`; also when
    the target was behind the camera."""
    here = pose.target_in_camera_km / pose.range_km
    there = camera.ray(np.asarray(xy_px, dtype=np.float64))
    return pose.replaced(camera_from_j2000=smallest_turn(here, there) @ pose.camera_from_j2000)


def is_offset_from(pose: Pose, other: Pose, camera: Camera) -> bool:
    """Whether an offset in the picture tells how the camera of `pose` must be turned to see the target where `other`
    does: the target is in front of it, and near that place."""
    here, there = (p.target_in_camera_km / p.range_km for p in (pose, other))
    near = float(here @ there) >= np.cos(np.radians(LARGEST_OFFSET_DEG))
    return near and bool(np.isfinite(camera.project([here, there])).all())


def pose_facing(pose: Pose, other: Pose, camera: Camera) -> Pose:
    """`pose` itself where it is an offset from `other` (see `is_offset_from`); else, also when its target is behind the
    camera, turned by the smallest rotation that puts the target's centre where `other` has it."""
    if is_offset_from(pose, other, camera):
        return pose
    return pose_pointed_at(pose, camera, camera.project(other.target_in_camera_km))


def smallest_turn(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smallest rotation (3, 3) that turns unit vector `a` (3,) to unit vector `b` (3,), also a nearly opposite one."""
    cosine = float(a @ b)
    if cosine > -0.5:
        axis = np.cross(a, b)
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        return np.eye(3) + cross + cross @ cross / (1 + cosine)
    # Two reflections by way of a vector square to b: nothing is divided by what vanishes for opposite vectors.
    between = a - cosine * b
    if np.linalg.norm(between) < 1e-6:
        between = np.cross(b, np.eye(3)[np.argmin(np.abs(b))])
    between /= np.linalg.norm(between)
    return _reflection(between, b) @ _reflection(a, between)


def _reflection(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The reflection (3, 3) that takes `a` (3,) to `b` (3,), of equal lengths."""
    apart = a - b
    return np.eye(3) - 2 * np.outer(apart, apart) / (apart @ apart)
