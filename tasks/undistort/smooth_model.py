"""A distortion model made of one smooth function from the raw to the undistorted frame."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tasks.undistort.mark_set import FitReport, MarkSet
from tasks.undistort.model import PointMap, Points, solve_points

MARGIN_PX = 30.0  # how far beyond the raw frame the function itself is used; the corners of object space need 24


@dataclass(frozen=True, eq=False)
class SmoothModel:
    """forward: raw points (n, 2) to undistorted ones; sigma_px: undistorted points (n, 2) to the expected 1-sigma error
    of one coordinate (n,).

    Beyond the raw frame by more than `MARGIN_PX` the best affine map carries on from the nearest place where the
    function is used: continuous, and tame however far away. The inverse is Newton's.
    """

    name: str
    marks: MarkSet
    forward: PointMap
    sigma_px: Callable[[Points], NDArray[np.float64]]
    report: FitReport
    degree: int | None = None

    @property
    def raw_size_px(self) -> tuple[int, int]:
        """Size (nx, ny) of the raw frame."""
        return self.marks.raw_size_px

    @property
    def size_px(self) -> tuple[int, int]:
        """Size (nx, ny) of the undistorted frame."""
        return self.marks.size_px

    def undistort_points(self, xy_raw: ArrayLike) -> Points:
        """Undistorted places (..., 2) of raw pixels (..., 2)."""
        raw = np.asarray(xy_raw, dtype=np.float64)
        return self._continued(raw.reshape(-1, 2)).reshape(raw.shape)

    def distort_points(self, xy: ArrayLike) -> Points:
        """Raw places (..., 2) of undistorted pixels (..., 2)."""
        points = np.asarray(xy, dtype=np.float64)
        matrix, shift = self._affine
        start = (points - shift) @ np.linalg.inv(matrix).T
        return solve_points(self._continued, points, start)

    def extrapolated(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """True (...,) for undistorted pixels outside the hull of the found marks."""
        points = np.asarray(xy, dtype=np.float64)
        return self.marks.beyond_hull(points.reshape(-1, 2)).reshape(points.shape[:-1])

    def uncertainty_px(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Expected 1-sigma error (...,) of one coordinate at undistorted pixels (..., 2), from leave-one-out errors."""
        points = np.asarray(xy, dtype=np.float64)
        return np.asarray(self.sigma_px(points.reshape(-1, 2)).reshape(points.shape[:-1]))

    def _continued(self, raw: Points) -> Points:
        last = np.asarray(self.raw_size_px, dtype=np.float64) - 1.0
        within = np.clip(raw, -MARGIN_PX, last + MARGIN_PX)
        matrix, _ = self._affine
        continued: Points = self.forward(within) + (raw - within) @ matrix.T
        return continued

    @cached_property
    def _affine(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Matrix and shift of the best affine map from raw to undistorted."""
        found = self.marks.found
        raw = self.marks.raw_xy[found]
        design = np.column_stack([raw, np.ones(len(raw))])
        solution = np.asarray(np.linalg.lstsq(design, self.marks.object_xy[found], rcond=None)[0], dtype=np.float64)
        return solution[:2].T, solution[2]
