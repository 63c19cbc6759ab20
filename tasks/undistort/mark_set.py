"""Pairs of raw and true mark places that a distortion model is fitted to, and how good the fit is."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from catalog.reseau import ReseauTable
from tasks.undistort.reseau_marks import SIGMA_FLOOR_PX, MarkState, ReseauMarks
from tasks.undistort.triangles import refuse_collinear

HIDDEN_SIGMA_PX = 2.0  # the table's places of marks outside the frame were never seen; they only steady the edges
ROBUST_LIMIT = 3.0

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MarkSet:
    """raw_xy, object_xy (n, 2): places in the raw and the undistorted frame, pixels, 0-based. sigma_px (n,): 1-sigma of
    a raw coordinate. found (n,): measured in this frame (or taken from a table as if they were); the others are
    expected places that steady a fit where nothing was found. outside (n,): beyond the raw frame's edge. nominal_xy
    (n, 2): raw places in the camera's table, None where there is none, or raw_xy is it."""

    raw_xy: Array
    object_xy: Array
    sigma_px: Array
    found: NDArray[np.bool_]
    outside: NDArray[np.bool_]
    raw_size_px: tuple[int, int]
    size_px: tuple[int, int]
    nominal_xy: Array | None = None

    def __post_init__(self) -> None:
        refuse_collinear(self.object_xy[self.found])

    def without(self, mark: int) -> "MarkSet":
        """All marks but one."""
        keep = np.arange(len(self.found)) != mark
        raw_xy, object_xy, sigma_px = self.raw_xy[keep], self.object_xy[keep], self.sigma_px[keep]
        sizes = (self.raw_size_px, self.size_px)
        nominal_xy = None if self.nominal_xy is None else self.nominal_xy[keep]
        return MarkSet(raw_xy, object_xy, sigma_px, self.found[keep], self.outside[keep], *sizes, nominal_xy)

    def beyond_hull(self, xy: Array) -> NDArray[np.bool_]:
        """True (n,) for undistorted pixels (n, 2) outside the convex hull of the found marks."""
        beyond = np.zeros(len(xy), dtype=bool)
        for across, down, offset in ConvexHull(self.object_xy[self.found]).equations:
            beyond |= xy[:, 0] * across + xy[:, 1] * down + offset > 1e-9
        return beyond


def marks_of_table(table: ReseauTable, raw_size_px: tuple[int, int], size_px: tuple[int, int]) -> MarkSet:
    """The table's nominal places, all taken for true."""
    everywhere = np.ones(len(table), dtype=bool)
    sigma_px = np.full(len(table), SIGMA_FLOOR_PX)
    return MarkSet(table.raw_xy, table.object_xy, sigma_px, everywhere, ~everywhere, raw_size_px, size_px)


def marks_of_frame(marks: ReseauMarks, raw_size_px: tuple[int, int], size_px: tuple[int, int]) -> MarkSet:
    """The marks measured in a frame, with the hidden ones at their expected places."""
    sigma_px = np.where(marks.found, marks.sigma_px, np.maximum(marks.sigma_px, HIDDEN_SIGMA_PX))
    outside = np.asarray(marks.state == MarkState.OUTSIDE)
    sizes = (raw_size_px, size_px)
    return MarkSet(marks.xy, marks.object_xy, sigma_px, marks.found, outside, *sizes, marks.nominal_xy)


@dataclass(frozen=True)
class FitReport:
    """How a method did. residual, leave_one_out (n, 2): undistorted pixels, predicted minus true place of each found
    mark, fitted with it and without it. place (n, 2): their true places. condition_number: of the solved system."""

    method: str
    place: Array
    residual: Array
    leave_one_out: Array
    condition_number: float

    @property
    def rmsd_px(self) -> float:
        """Root mean square distance between predicted and true marks (the paper's RMSD)."""
        return _rms(self.residual)

    @property
    def leave_one_out_px(self) -> float:
        """The same when each mark is predicted from the others."""
        return _rms(self.leave_one_out)

    @property
    def robust_leave_one_out_px(self) -> float:
        """The same with no mark counted as more than `ROBUST_LIMIT` times the median."""
        return robust_rms(self.leave_one_out)

    @property
    def leave_one_out_median_px(self) -> float:
        """Median distance when each mark is predicted from the others."""
        return float(np.median(np.linalg.norm(self.leave_one_out, axis=1)))

    def summary(self) -> dict[str, Any]:
        """Plain numbers for evidence and tables."""
        return {
            "rmsd_px": self.rmsd_px,
            "leave_one_out_px": self.leave_one_out_px,
            "leave_one_out_median_px": self.leave_one_out_median_px,
            "condition_number": self.condition_number,
        }


def robust_rms(vectors: Array) -> float:
    """Root mean square length of vectors (n, 2), none counted as more than `ROBUST_LIMIT` times the median."""
    distance = np.linalg.norm(vectors, axis=1)
    return float(np.sqrt((np.minimum(distance, ROBUST_LIMIT * np.median(distance)) ** 2).mean()))


def _rms(vectors: Array) -> float:
    return float(np.sqrt((vectors**2).sum(axis=1).mean()))
