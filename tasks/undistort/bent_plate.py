"""Thin-plate spline and beam bending together: the marks tell the smooth distortion, the image its own bending."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.robust import huber_weight, sigma_about_zero
from tasks.undistort.bending import USUAL_PX_PER_DN, USUAL_SPREAD_PX_PER_DN, BendingField
from tasks.undistort.mark_set import FitReport, MarkSet
from tasks.undistort.model import PointMap, Points, solve_points
from tasks.undistort.smooth_model import SmoothModel
from tasks.undistort.smooth_surface import SMOOTHING, SmoothSurface
from tasks.undistort.thin_plate import DEFAULT_DEGREE, plate_of_surface

ROBUST_STEPS = 6
ROBUST_LIMIT = 2.0
SIGNIFICANT = 4.0

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BentModel:
    """undistorted = smooth(raw) + px_per_dn * field(raw). spread: the 1-sigma of px_per_dn. absorbed: raw points (n, 2)
    to how much of the field there (n, 2) the smooth part takes up when it is fitted to the marks again."""

    smooth_part: SmoothModel
    field: BendingField
    px_per_dn: float
    spread: float
    report: FitReport
    absorbed: PointMap
    name: str = "beam-bending"

    smooth = False

    @property
    def marks(self) -> MarkSet:
        """The marks it was fitted to."""
        return self.smooth_part.marks

    @property
    def raw_size_px(self) -> tuple[int, int]:
        """Size (nx, ny) of the raw frame."""
        return self.smooth_part.raw_size_px

    @property
    def size_px(self) -> tuple[int, int]:
        """Size (nx, ny) of the undistorted frame."""
        return self.smooth_part.size_px

    def undistort_points(self, xy_raw: ArrayLike) -> Points:
        """Undistorted places (..., 2) of raw pixels (..., 2)."""
        raw = np.asarray(xy_raw, dtype=np.float64)
        bend = self.px_per_dn * self.field(raw.reshape(-1, 2)).reshape(raw.shape)
        return self.smooth_part.undistort_points(raw) + bend

    def distort_points(self, xy: ArrayLike) -> Points:
        """Raw places (..., 2) of undistorted pixels (..., 2)."""
        return solve_points(self.undistort_points, xy, self.smooth_part.distort_points(xy))

    def extrapolated(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """True (...,) for undistorted pixels outside the hull of the found marks."""
        return self.smooth_part.extrapolated(xy)

    def uncertainty_px(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Expected 1-sigma error (...,) of one coordinate: the smooth part's, and the spread of the bending."""
        points = np.asarray(xy, dtype=np.float64)
        raw = self.smooth_part.distort_points(points).reshape(-1, 2)
        length = np.linalg.norm(self.field(raw) - self.absorbed(raw), axis=-1).reshape(points.shape[:-1]) / np.sqrt(2.0)
        return np.hypot(self.smooth_part.uncertainty_px(points), self.spread * length)


def fit_bent_plate(
    marks: MarkSet, field: BendingField, degree: int = DEFAULT_DEGREE, smoothing: float = SMOOTHING
) -> BentModel:
    """Thin plate through the marks with their bending taken off; its coefficient is what this frame's marks give
    together with what other frames gave (for raw data numbers).

    In other units it is taken only when it is `SIGNIFICANT` times its error. Raises RefusedError as `fit_thin_plate`.
    """
    both = _places_and_pulls(marks, field, degree, smoothing)
    px_per_dn, spread = with_experience(*_coefficient_of(both, marks), field.in_dn)
    pull = field(marks.raw_xy)
    surface = both.through(marks.object_xy - px_per_dn * pull, assessed=marks.found)
    plate = plate_of_surface(marks, surface, degree)
    return BentModel(plate, field, px_per_dn, spread, replace(plate.report, method="beam-bending"), both.through(pull))


def coefficient_of_frame(
    marks: MarkSet, field: BendingField, degree: int = DEFAULT_DEGREE, smoothing: float = SMOOTHING
) -> tuple[float, float]:
    """Bending in undistorted px per DN that makes the marks best predicted from each other, robustly, and its error;
    (0, inf) for a frame without brightness."""
    return _coefficient_of(_places_and_pulls(marks, field, degree, smoothing), marks)


def _places_and_pulls(marks: MarkSet, field: BendingField, degree: int, smoothing: float) -> SmoothSurface:
    values = np.hstack([marks.object_xy, field(marks.raw_xy)])
    return SmoothSurface(marks.raw_xy, values, marks.sigma_px, marks.raw_size_px, degree, smoothing)


def _coefficient_of(both: SmoothSurface, marks: MarkSet) -> tuple[float, float]:
    left_out = (both.leave_one_out / marks.sigma_px[:, None])[marks.found]
    return coefficient(left_out[:, :2].ravel(), left_out[:, 2:].ravel())


def coefficient(errors: Array, pulls: Array) -> tuple[float, float]:
    """Least squares of errors = k pulls with Huber's weights, both in stated sigmas, and the error of k: from the
    scatter of all, from that of the few that say most (White 1980, Econometrica 48, 817), or from the stated sigmas,
    whichever is largest: often one mark beside the limb says nearly all, and need not be as good as the others are."""
    weight, k = np.ones_like(errors), 0.0
    for _ in range(ROBUST_STEPS):
        norm = float((weight * pulls * pulls).sum())
        if norm <= 0.0:
            return 0.0, float("inf")
        k = float((weight * errors * pulls).sum()) / norm
        rest = errors - k * pulls
        weight = huber_weight(np.abs(rest), ROBUST_LIMIT * sigma_about_zero(rest))
    alike = max(float(np.average(rest**2, weights=weight)), 1.0) / norm
    apart = float(((weight * pulls * rest) ** 2).sum()) / norm**2
    return k, float(np.sqrt(max(alike, apart)))


def with_experience(k: float, spread: float, in_dn: bool) -> tuple[float, float]:
    """A frame's own coefficient and its error, weighed together with what other frames gave."""
    if not in_dn:
        return (k, spread) if k > SIGNIFICANT * spread else (0.0, 0.0)
    ours, usual = 1.0 / spread**2, 1.0 / USUAL_SPREAD_PX_PER_DN**2
    return (ours * k + usual * USUAL_PX_PER_DN) / (ours + usual), float(np.sqrt(1.0 / (ours + usual)))
