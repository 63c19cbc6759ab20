"""Maps of a whole frame: where each undistorted pixel lies in the raw one, and how sure that is."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.undistort.bent_plate import BentModel
from tasks.undistort.model import DistortionModel
from tasks.undistort.turned import TurnedModel

COARSE_STEP_PX = 10
UNCERTAINTY_STEP_PX = 40
BLOCK_ROWS = 100
BENDING_STEPS = 20
BENDING_TOLERANCE_PX = 1e-3
MODELS_REMEMBERED = 8

Array = NDArray[np.float64]
Plane = NDArray[np.float32]


@lru_cache(maxsize=MODELS_REMEMBERED)
def raw_places(model: DistortionModel) -> tuple[Plane, Plane, NDArray[np.bool_]]:
    """Raw x and y, each float32 (ny, nx), of all undistorted pixels, and which of them are extrapolated.

    Remembered for the last few models. Smooth models are evaluated every `COARSE_STEP_PX` and interpolated by cubic
    splines (off by up to 0.002 px beside a mark), since their inverse is a Newton iteration.
    """
    columns, rows = model.size_px
    xy = _places(model).astype(np.float32)
    outside = model.extrapolated(_grid(np.arange(columns), np.arange(rows)))
    return np.ascontiguousarray(xy[..., 0]), np.ascontiguousarray(xy[..., 1]), outside


@lru_cache(maxsize=MODELS_REMEMBERED)
def uncertainty_plane(model: DistortionModel) -> Plane:
    """Expected 1-sigma error of one coordinate, float32 (ny, nx), undistorted pixels, at each undistorted pixel: what
    the distortion adds to the error of a place. Interpolated from a coarse grid; remembered for the last few models."""
    return _from_coarse(model.uncertainty_px, model.size_px, UNCERTAINTY_STEP_PX)


def bending_error_planes(model: DistortionModel) -> Plane | None:
    """Displacement (2, ny, nx), x and y in undistorted pixels, of each undistorted pixel if the beam is bent by 1-sigma
    more than the model has it, and its smooth part fitted to the marks again; None where the model knows no bending, or
    no error of it."""
    import cv2

    if not isinstance(model, BentModel) or not model.spread:
        return None
    at_x, at_y, _ = raw_places(model)
    moved = [
        cv2.remap(plane, at_x, at_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for plane in model.field.planes
    ]

    def absorbed(xy: Array) -> Array:
        x, y = (np.rint(xy[..., axis]).astype(int) for axis in range(2))
        raw = np.stack([at_x[y, x], at_y[y, x]], axis=-1).astype(np.float64)
        return model.absorbed(raw.reshape(-1, 2)).reshape(xy.shape)

    taken_up = np.moveaxis(_from_coarse(absorbed, model.size_px, COARSE_STEP_PX), -1, 0)
    return np.asarray((np.stack(moved) - taken_up) * np.float32(model.spread))


def undistorted_places(model: DistortionModel) -> Array:
    """Undistorted places (ny, nx, 2), x and y, of all pixels of the raw frame: with them the geometry of unresampled
    pixels is projected (sensor space)."""
    columns, rows = model.raw_size_px
    grid = _grid(np.arange(columns), np.arange(rows))
    blocks = np.array_split(grid, max(1, rows // BLOCK_ROWS))
    return np.concatenate([model.undistort_points(block) for block in blocks])


def _from_coarse(function: Callable[[Array], Array], size_px: tuple[int, int], step_px: int) -> Plane:
    """A smooth function of undistorted pixels (..., 2), float32 (ny, nx) or (ny, nx, k), evaluated on a coarse grid."""
    import cv2

    columns, rows = size_px
    x, y = (np.linspace(0, n - 1, max(n // step_px + 1, 4)) for n in (columns, rows))
    coarse = function(_grid(x, y)).astype(np.float32)
    at_x = np.arange(columns, dtype=np.float32) * np.float32((len(x) - 1) / (columns - 1))
    at_y = np.arange(rows, dtype=np.float32) * np.float32((len(y) - 1) / (rows - 1))
    map_x, map_y = np.meshgrid(at_x, at_y)
    return np.asarray(cv2.remap(coarse, map_x, map_y, cv2.INTER_LINEAR), dtype=np.float32)


def _places(model: DistortionModel) -> Array:
    """Raw places (ny, nx, 2) of all undistorted pixels."""
    if isinstance(model, TurnedModel):
        return _turned(model)
    if isinstance(model, BentModel):
        return _bent(model)
    columns, rows = model.size_px
    splined = _splined(model, columns, rows) if getattr(model, "smooth", True) else None
    return splined if splined is not None else _in_blocks(model, _grid(np.arange(columns), np.arange(rows)))


def _grid(x: NDArray, y: NDArray) -> Array:
    return np.stack(np.meshgrid(x, y), axis=-1).astype(np.float64)


def _in_blocks(model: DistortionModel, grid: Array) -> Array:
    blocks = np.array_split(grid, max(1, len(grid) // BLOCK_ROWS))
    return np.concatenate([model.distort_points(rows) for rows in blocks])


def _splined(model: DistortionModel, columns: int, rows: int) -> Array | None:
    """Raw places (rows, columns, 2) from a coarse grid; None where the model has gaps, which splines cannot bridge.

    The model's own inverse is evaluated at every second node only; one Newton step, whose derivative is that of the
    spline through those, brings the other nodes to it.
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


def _splines(x: Array, y: Array, values: Array) -> list[Any]:
    """Cubic splines (line first) through values (ny, nx, 2)."""
    from scipy.interpolate import RectBivariateSpline

    return [RectBivariateSpline(y, x, values[..., axis]) for axis in range(2)]


def _bent(model: BentModel) -> Array:
    """The smooth part's places, moved against the bending until both agree: raw = smooth^-1(xy - bending(raw))."""
    import cv2

    unbent = _places(model.smooth_part)
    along_y, along_x = np.gradient(unbent, axis=(0, 1))
    pull = model.field.planes * np.float32(model.px_per_dn)
    places = unbent
    for _ in range(BENDING_STEPS):
        map_x, map_y = (np.ascontiguousarray(places[..., axis], np.float32) for axis in range(2))
        bend = [cv2.remap(p, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for p in pull]
        moved = unbent - along_x * bend[0][..., None] - along_y * bend[1][..., None]
        change = float(np.abs(moved - places).max())
        places = moved
        if change < BENDING_TOLERANCE_PX:
            break
    return places


def _turned(model: TurnedModel) -> Array:
    """The inner model's places, looked up at the turned pixels (bilinear: its places are smooth over a pixel)."""
    import cv2

    columns, rows = model.size_px
    at = model.unturned(_grid(np.arange(columns), np.arange(rows)))
    map_x, map_y = (np.ascontiguousarray(at[..., axis], np.float32) for axis in range(2))
    inner = _places(model.model).astype(np.float32)
    planes = [
        cv2.remap(
            np.ascontiguousarray(inner[..., axis]), map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        for axis in range(2)
    ]
    inside = (map_x >= 0) & (map_x <= columns - 1) & (map_y >= 0) & (map_y <= rows - 1)
    places = np.stack(planes, axis=-1).astype(np.float64)
    places[~inside] = model.model.distort_points(at[~inside])
    return places
