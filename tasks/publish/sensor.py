"""Sensor space: pixels that stay on the detector, and what belongs to them in the undistorted frame."""

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.observation import Quality
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.backplanes import KNOWN_PLANES, Backplanes
from tasks.project.pixels import project_pixels
from tasks.publish.publication import SensorFrame


def sensor_planes(pose: Pose, camera: Camera, target: Target, sensor: SensorFrame) -> Backplanes:
    """All planes for the centres of the raw pixels (ny, nx); `window` is that of the raw frame. The resolution is that
    of a raw pixel, whose size in undistorted pixels is not 1. Raises RefusedError as `project_pixels`."""
    ny, nx = sensor.observation.image.shape
    planes = project_pixels(pose, camera, target, sensor.xy_px, KNOWN_PLANES)
    planes["resolution_km"] *= pixel_sizes(sensor.xy_px)
    return Backplanes((0, 0, nx, ny), planes)


def pixel_sizes(xy_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Side (ny, nx), in undistorted pixels, of the square that has a raw pixel's area; the median beside gaps."""
    along_y, along_x = (np.asarray(np.gradient(xy_px, axis=axis)) for axis in range(2))
    size = np.sqrt(np.abs(along_x[..., 0] * along_y[..., 1] - along_x[..., 1] * along_y[..., 0]))
    known = np.isfinite(size)
    return np.where(known, size, np.median(size[known]) if known.any() else 1.0)


def sampled_at_places(plane: NDArray[np.float32], sensor: SensorFrame) -> NDArray[np.float32]:
    """Values (ny, nx) of an undistorted plane at the raw pixels' places, linear; its edge's beyond it, NaN in gaps."""
    import cv2

    x, y = (np.ascontiguousarray(sensor.xy_px[..., axis], np.float32) for axis in range(2))
    values = cv2.remap(plane, np.nan_to_num(x), np.nan_to_num(y), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.where(np.isfinite(x) & np.isfinite(y), values, np.float32(np.nan)).astype(np.float32)


def sensor_quality(sensor: SensorFrame, undistorted_quality: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Flags (ny, nx) of the raw pixels, and EXTRAPOLATED_DISTORTION where the undistorted frame has it, or in gaps."""
    extrapolated = ((undistorted_quality & Quality.EXTRAPOLATED_DISTORTION) != 0).astype(np.float32)
    at_places = sampled_at_places(extrapolated, sensor)
    quality = sensor.observation.quality.copy()
    quality[~(at_places < 0.5)] |= np.uint16(Quality.EXTRAPOLATED_DISTORTION)
    return quality
