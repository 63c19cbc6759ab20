"""The camera's table of marks, warped smoothly onto the frame: what the tube always does is taken from the table, and
the frame's marks only have to tell how this frame differs from it.

Where the table's own irregularities are real, as in the tubes of Voyager 1, this predicts a mark better than a surface
through the frame's marks alone; where they are errors of the table it does not, and `choose` takes the other.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.undistort.bending import BendingField
from tasks.undistort.bent_plate import BentModel, coefficient, with_experience
from tasks.undistort.mark_set import FitReport, MarkSet, robust_rms
from tasks.undistort.model import Points, solve_points
from tasks.undistort.reseau_marks import SIGMA_FLOOR_PX
from tasks.undistort.smooth_model import SmoothModel
from tasks.undistort.smooth_surface import SmoothSurface
from tasks.undistort.thin_plate import DEFAULT_DEGREE as TABLE_DEGREE

WARP_DEGREE = 3
# How closely the table is followed, and how stiff the warp is: the pair that predicts this frame's marks best is taken.
TABLE_SMOOTHING = (0.01, 0.2)
WARP_SMOOTHING = (0.2, 2.0, 20.0, 200.0)
ROBUST_ROUNDS, OUTLIER = 2, 4.0
DERIVATIVE_PX = 1.0
# The error between the table's marks, by that at a mark left out: half as far from the next, and falling as its square.
BETWEEN = 0.25

Array = NDArray[np.float64]


def fit_warped_table(marks: MarkSet, field: BendingField, degree: int = WARP_DEGREE) -> BentModel:
    """undistorted = table(raw - warp(raw)) + px_per_dn * field(raw), with the warp a smooth surface of low order.

    Stiffness is chosen by leave-one-out errors; marks that the others contradict count less. Raises RefusedError when
    the marks come without a table, or are too few.
    """
    nominal_xy = marks.nominal_xy
    if nominal_xy is None:
        raise RefusedError(
            Reason.MARKS_WITHOUT_TABLE,
            "the method warped-table needs marks measured in a frame and the camera's table of the same marks.",
            "Use the method thin-plate.",
        )
    tables = [_Table.of(marks, nominal_xy, smoothing) for smoothing in TABLE_SMOOTHING]
    pull = field(marks.raw_xy)
    fits = (_Warp.of(marks, table, pull, field, degree, smoothing) for table in tables for smoothing in WARP_SMOOTHING)
    return min(fits, key=lambda fit: robust_rms(fit.leave_one_out)).model(marks, field, degree)


@dataclass(frozen=True, eq=False)
class _Table:
    """The table as a smooth map from raw to undistorted; unwarped_xy (n, 2): where it has each mark's true place in the
    raw frame; slope (n, 2, 2): its derivative there."""

    forward: SmoothSurface
    unwarped_xy: Array
    slope: Array

    @classmethod
    def of(cls, marks: MarkSet, nominal_xy: Array, smoothing: float) -> "_Table":
        sigma = np.full(len(nominal_xy), SIGMA_FLOOR_PX)
        surface = SmoothSurface(nominal_xy, marks.object_xy, sigma, marks.raw_size_px, TABLE_DEGREE, smoothing)
        unwarped = solve_points(surface, marks.object_xy, nominal_xy)
        steps = DERIVATIVE_PX * np.eye(2)
        slope = [(surface(unwarped + h) - surface(unwarped - h)) / (2 * DERIVATIVE_PX) for h in steps]
        return cls(surface, unwarped, np.stack(slope, axis=-1))


@dataclass(frozen=True, eq=False)
class _Warp:
    """One fit: the table and its warp; the bending's coefficient and its 1-sigma; slope (n, 2, 2): the table's
    derivative at the found marks; leave_one_out (n, 2): their errors in undistorted pixels."""

    table: _Table
    surface: SmoothSurface
    px_per_dn: float
    spread: float
    slope: Array
    leave_one_out: Array

    @classmethod
    def of(
        cls, marks: MarkSet, table: _Table, pull: Array, field: BendingField, degree: int, smoothing: float
    ) -> "_Warp":
        """pull (n, 2): the field at the marks."""
        found, size_px = marks.found, marks.raw_size_px
        moved = marks.raw_xy - table.unwarped_xy
        pull = np.asarray(np.linalg.solve(table.slope, pull[..., None])[..., 0], np.float64)
        sigma = marks.sigma_px.copy()
        for _ in range(ROBUST_ROUNDS):
            both = SmoothSurface(marks.raw_xy, np.hstack([moved, -pull]), sigma, size_px, degree, smoothing)
            left_out = (both.leave_one_out / marks.sigma_px[:, None])[found]
            errors, pulls = left_out[:, :2], left_out[:, 2:]
            k, spread = with_experience(*coefficient(errors.ravel(), pulls.ravel()), field.in_dn)
            size = np.linalg.norm(errors - k * pulls, axis=1)
            sigma[found] = marks.sigma_px[found] * np.maximum(size / (OUTLIER * np.median(size)), 1.0)
        warp = SmoothSurface(marks.raw_xy, moved + k * pull, sigma, size_px, degree, smoothing, assessed=found)
        slope = table.slope[found]
        return cls(table, warp, k, spread, slope, np.einsum("nij,nj->ni", slope, warp.leave_one_out[found]))

    def model(self, marks: MarkSet, field: BendingField, degree: int) -> BentModel:
        """The distortion model of this fit."""
        warp, table, found = self.surface, self.table, marks.found
        residual = np.einsum("nij,nj->ni", self.slope, warp.residual[found])
        report = FitReport("warped-table", marks.object_xy[found], residual, self.leave_one_out, warp.condition_number)
        scale = float(np.sqrt(np.abs(np.linalg.det(self.slope)).mean()))

        def forward(raw: Points) -> Points:
            return table.forward(raw - warp(raw))

        def sigma_px(points: Points) -> Array:
            raw = model.distort_points(points)
            return np.hypot(scale * warp.sigma_at(raw), BETWEEN * table.forward.sigma_at(raw))

        model = SmoothModel("warped-table", marks, forward, sigma_px, report, degree)
        absorbed = warp.through(field(marks.raw_xy))
        return BentModel(model, field, self.px_per_dn, self.spread, report, absorbed, "warped-table")
