"""Which frames are close-ups: those that cannot show enough of the disk for the limb to lead."""

import numpy as np

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.closeup.settings import CloseUpSettings
from tasks.simulate.window import disk_radius_px

# A frame of which less shows the target may have it elsewhere altogether, and is no close-up.
LEAST_COVER = 0.1
STEPS = 61


def is_close_up(pose: Pose, camera: Camera, target: Target, settings: CloseUpSettings, has_map: bool = True) -> bool:
    """Whether less than `settings.share` of the target's disk is in the frame wherever within `settings.reach_px` of
    its predicted place the target is, and the target fills a part of the frame there. Of a target without a base map
    the arc of limb in the frame is all there is: a close-up is then but what the target fills where it is predicted."""
    centre = camera.project(pose.target_in_camera_km)
    if settings.share == 0 or not np.isfinite(centre).all():
        return False
    radius_px = disk_radius_px(pose, camera, target)
    if not has_map and shares(centre, radius_px, camera)[1] < 1:
        return False
    away = (np.asarray(camera.size_px) - 1) / 2 - centre
    distance = float(np.hypot(*away))
    nearest = centre + away * min(1.0, settings.reach_px / max(distance, 1e-9))
    share, cover = shares(nearest, radius_px, camera)
    return bool(share < settings.share and cover > LEAST_COVER)


def shares(centre: np.ndarray, radius_px: float, camera: Camera) -> tuple[float, float]:
    """Part of a disk about `centre` (2,) that is in the frame, and part of the frame that it fills."""
    nx, ny = camera.size_px
    x, y = np.meshgrid(np.linspace(0, nx - 1, STEPS), np.linspace(0, ny - 1, STEPS))
    cover = float(np.mean(np.hypot(x - centre[0], y - centre[1]) < radius_px))
    return cover * nx * ny / (np.pi * radius_px**2), cover
