"""Resampling of a raw frame into the undistorted one, with its noise and quality."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import UNUSABLE, Observation, Quality
from tasks.undistort.model import DistortionModel
from tasks.undistort.settings import Kernel

COARSE_STEP_PX = 10
CUBIC_A = -0.75  # OpenCV's bicubic
LANCZOS_LOBES = 4
KERNEL_REACH_PX = {"bilinear": 1, "bicubic": 2, "lanczos": 4}


@lru_cache(maxsize=8)
def raw_places(model: DistortionModel) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Raw x and y, each float32 (ny, nx), of all undistorted pixels, and which of them are extrapolated.

    Remembered for the last few models. Models that call themselves smooth are evaluated every `COARSE_STEP_PX` and
    interpolated by cubic splines (off by up to 0.002 px beside a mark), since their inverse is a Newton iteration.
    """
    columns, rows = model.size_px
    grid = _grid(np.arange(columns), np.arange(rows))
    xy = _splined(model, columns, rows) if getattr(model, "smooth", True) else None
    if xy is None:
        xy = _in_blocks(model, grid)
    outside = model.extrapolated(grid)
    return np.ascontiguousarray(xy[..., 0], np.float32), np.ascontiguousarray(xy[..., 1], np.float32), outside


def _grid(x: NDArray, y: NDArray) -> NDArray[np.float64]:
    return np.stack(np.meshgrid(x, y), axis=-1).astype(np.float64)


def _in_blocks(model: DistortionModel, grid: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([model.distort_points(rows) for rows in np.array_split(grid, max(1, len(grid) // 100))])


def _splined(model: DistortionModel, columns: int, rows: int) -> NDArray[np.float64] | None:
    """Raw places (rows, columns, 2) from a coarse grid; None where the model has gaps, which splines cannot bridge.

    The model's own inverse is asked at every second node only; one Newton step, whose derivative is that of the spline
    through those, brings the other nodes to it.
    """
    rough_x, rough_y = (np.linspace(0, n - 1, max(n // (2 * COARSE_STEP_PX) + 1, 4)) for n in (columns, rows))
    rough = model.distort_points(_grid(rough_x, rough_y))
    if not np.isfinite(rough).all():
        return None
    through_rough = _splines(rough_x, rough_y, rough)
    x, y = (np.linspace(0, n - 1, max(n // COARSE_STEP_PX + 1, 4)) for n in (columns, rows))
    places = np.stack([spline(y, x) for spline in through_rough], axis=-1)
    missed = model.undistort_points(places) - _grid(x, y)
    for axis, spline in enumerate(through_rough):
        places[..., axis] -= spline(y, x, dy=1) * missed[..., 0] + spline(y, x, dx=1) * missed[..., 1]
    return np.stack([spline(np.arange(rows), np.arange(columns)) for spline in _splines(x, y, places)], axis=-1)


def _splines(x: NDArray[np.float64], y: NDArray[np.float64], values: NDArray[np.float64]) -> list[Any]:
    """Cubic splines (line first) through values (ny, nx, 2)."""
    from scipy.interpolate import RectBivariateSpline

    return [RectBivariateSpline(y, x, values[..., axis]) for axis in range(2)]


@lru_cache(maxsize=8)
def uncertainty_plane(model: DistortionModel) -> NDArray[np.float32]:
    """Expected 1-sigma error of one coordinate, float32 (ny, nx), undistorted pixels, at each undistorted pixel: what
    the distortion adds to the error of a place. Interpolated from a coarse grid; remembered for the last few models."""
    import cv2

    columns, rows = model.size_px
    step = 4 * COARSE_STEP_PX
    x, y = (np.linspace(0, n - 1, max(n // step + 1, 4)) for n in (columns, rows))
    coarse = model.uncertainty_px(_grid(x, y)).astype(np.float32)
    at_x = np.arange(columns, dtype=np.float32) * np.float32((len(x) - 1) / (columns - 1))
    at_y = np.arange(rows, dtype=np.float32) * np.float32((len(y) - 1) / (rows - 1))
    map_x, map_y = np.meshgrid(at_x, at_y)
    return np.asarray(cv2.remap(coarse, map_x, map_y, cv2.INTER_LINEAR), dtype=np.float32)


def resampled(observation: Observation, model: DistortionModel, kernel: Kernel = "bilinear") -> Observation:
    """Observation in the undistorted frame of `model`, from one in its raw frame.

    Noise: the variance is interpolated bilinearly and multiplied by the sum of the kernel's squared weights, which is
    the variance of the sum when neighbours have similar noise; neighbours become correlated, which is not recorded.
    Quality: flags of the nearest raw pixel, and every unusable bit of any pixel that the kernel touches. Pixels that
    fall outside the raw frame are 0 and OUTSIDE_WINDOW; those the model extrapolates are EXTRAPOLATED_DISTORTION.
    """
    import cv2

    x, y, extrapolated = raw_places(model)
    interpolation = {"bilinear": cv2.INTER_LINEAR, "bicubic": cv2.INTER_CUBIC, "lanczos": cv2.INTER_LANCZOS4}[kernel]
    image = cv2.remap(_finite(observation.image), x, y, interpolation, borderMode=cv2.BORDER_REPLICATE)
    variance = cv2.remap(_finite(observation.noise) ** 2, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    variance *= _squared_weights(x, kernel) * _squared_weights(y, kernel)
    quality = cv2.remap(observation.quality, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    quality |= _touched_faults(observation.quality, x, y, kernel)
    quality[extrapolated] |= np.uint16(Quality.EXTRAPOLATED_DISTORTION)
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
