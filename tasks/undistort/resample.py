"""Resampling of a raw frame into the undistorted one, with its noise and quality."""

import numpy as np
from numpy.typing import NDArray

from catalog.observation import UNUSABLE, Observation, Quality
from tasks.undistort.frame_map import raw_places
from tasks.undistort.model import DistortionModel
from tasks.undistort.settings import Kernel

CUBIC_A = -0.75  # OpenCV's bicubic
LANCZOS_LOBES = 4
KERNEL_REACH_PX = {"bilinear": 1, "bicubic": 2, "lanczos": 4}


def resampled(observation: Observation, model: DistortionModel, kernel: Kernel = "bilinear") -> Observation:
    """Observation in the undistorted frame of `model`, from one in its raw frame.

    Noise: the variance is interpolated bilinearly and multiplied by the sum of the kernel's squared weights, which is
    the variance of the sum when neighbours have similar noise; neighbours become correlated, which is not recorded.
    Quality: flags of the nearest raw pixel, and every unusable bit of any pixel that the kernel touches. Pixels that
    fall outside the raw frame are 0 and OUTSIDE_WINDOW; those the model extrapolates are EXTRAPOLATED_DISTORTION.
    """
    x, y, extrapolated = raw_places(model)
    found = _taken_from(observation, x, y, kernel)
    found.quality[extrapolated] |= np.uint16(Quality.EXTRAPOLATED_DISTORTION)
    return found


def displaced(observation: Observation, displacement: NDArray[np.float32]) -> Observation:
    """Observation whose pixels are taken from `displacement` (2, ny, nx), x and y in pixels, away; noise and quality as
    in `resampled`. Bilinear: exact in position."""
    y, x = np.indices(observation.image.shape, dtype=np.float32)
    return _taken_from(observation, x + displacement[0], y + displacement[1], "bilinear")


def _taken_from(
    observation: Observation, x: NDArray[np.float32], y: NDArray[np.float32], kernel: Kernel
) -> Observation:
    """Observation interpolated at the places x, y (ny, nx)."""
    import cv2

    interpolation = {"bilinear": cv2.INTER_LINEAR, "bicubic": cv2.INTER_CUBIC, "lanczos": cv2.INTER_LANCZOS4}[kernel]
    image = cv2.remap(_finite(observation.image), x, y, interpolation, borderMode=cv2.BORDER_REPLICATE)
    variance = cv2.remap(_finite(observation.noise) ** 2, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    variance *= _squared_weights(x, kernel) * _squared_weights(y, kernel)
    quality = cv2.remap(observation.quality, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    quality |= _touched_faults(observation.quality, x, y, kernel)
    rows, columns = observation.image.shape
    outside = ~((x >= -0.5) & (x <= columns - 0.5) & (y >= -0.5) & (y <= rows - 0.5))
    quality[outside] |= np.uint16(Quality.OUTSIDE_WINDOW)
    image[outside] = 0.0
    return Observation(image, np.sqrt(variance), quality)


def _finite(plane: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.nan_to_num(plane.astype(np.float32, copy=False), nan=0.0, posinf=0.0, neginf=0.0)


def _touched_faults(
    quality: NDArray[np.uint16], x: NDArray[np.float32], y: NDArray[np.float32], kernel: Kernel
) -> NDArray[np.uint16]:
    """Unusable bits (ny, nx) of all raw pixels within the kernel's reach of each raw place."""
    import cv2

    faults = np.zeros(x.shape, dtype=np.uint16)
    window = np.ones((2 * KERNEL_REACH_PX[kernel] - 1,) * 2, dtype=np.uint8)
    for bit in UNUSABLE:
        marked = (quality & np.uint16(bit)) != 0
        if marked.any():
            reach = cv2.dilate(marked.astype(np.uint8), window).astype(np.float32)
            touched = cv2.remap(reach, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) > 1e-6
            faults[touched] |= np.uint16(bit)
    return faults


def _squared_weights(place: NDArray[np.float32], kernel: Kernel) -> NDArray[np.float32]:
    """Sum of the squared one-dimensional kernel weights at each place, by its fraction of a pixel."""
    steps = 256
    table = (_kernel_weights(np.linspace(0.0, 1.0, steps + 1), kernel) ** 2).sum(axis=0).astype(np.float32)
    fraction = place - np.floor(place)
    return table[np.nan_to_num(fraction * steps).astype(np.int64)]


def _kernel_weights(fraction: NDArray[np.float64], kernel: Kernel) -> NDArray[np.float64]:
    reach = KERNEL_REACH_PX[kernel]
    distance = np.abs(fraction[None] - np.arange(1 - reach, reach + 1)[:, None])
    if kernel == "bilinear":
        return np.maximum(1.0 - distance, 0.0)
    if kernel == "bicubic":
        near = (CUBIC_A + 2) * distance**3 - (CUBIC_A + 3) * distance**2 + 1
        return np.where(distance <= 1, near, CUBIC_A * (distance**3 - 5 * distance**2 + 8 * distance - 4))
    weights = np.sinc(distance) * np.sinc(distance / LANCZOS_LOBES) * (distance < LANCZOS_LOBES)
    return weights / weights.sum(axis=0)
