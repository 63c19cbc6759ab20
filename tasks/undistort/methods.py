"""The methods that fit a distortion model to marks, by name and behind one signature."""

from collections.abc import Callable
from typing import Any

from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.undistort.bending import BendingField
from tasks.undistort.bent_plate import BentModel, fit_bent_plate
from tasks.undistort.delaunay import DelaunayModel
from tasks.undistort.mark_set import MarkSet
from tasks.undistort.polynomial import fit_polynomial
from tasks.undistort.radial import fit_radial
from tasks.undistort.smooth_model import SmoothModel
from tasks.undistort.thin_plate import fit_thin_plate
from tasks.undistort.warped_table import fit_warped_table

FittedModel = SmoothModel | DelaunayModel | BentModel

_WITH_DEGREE: dict[str, Callable[..., SmoothModel]] = {
    "radial": fit_radial,
    "polynomial": fit_polynomial,
    "thin-plate": fit_thin_plate,
}
BENDING, WARPED = "beam-bending", "warped-table"
METHODS = ("radial", "polynomial", "delaunay", "thin-plate", BENDING, WARPED)
# What needs a frame's own marks and brightness.
OF_A_FRAME = (BENDING, WARPED)


def fit_model(
    method: str, marks: MarkSet, degree: int | None = None, bending: BendingField | None = None
) -> FittedModel:
    """Fit `method` (one of `METHODS`) to the marks; degree None is the method's default. bending: the frame's, which
    the method beam-bending needs.

    Raises RefusedError when the marks are too few, collinear or out of order, the degree is too high for them, or the
    method is unknown or lacks what it needs.
    """
    given: dict[str, Any] = {} if degree is None else {"degree": degree}
    if method == "delaunay":
        return DelaunayModel(marks)
    if method in OF_A_FRAME:
        if bending is None:
            raise RefusedError(
                Reason.BENDING_WITHOUT_FRAME,
                "beam bending follows from the brightness of a frame and the marks found in it, and there is none.",
                "Use the method thin-plate with a table of marks.",
            )
        return (
            fit_bent_plate(marks, bending, **given) if method == BENDING else fit_warped_table(marks, bending, **given)
        )
    if method not in _WITH_DEGREE:
        raise RefusedError(
            Reason.METHOD_UNKNOWN, f"no distortion method is called {method!r}.", f"Use one of {METHODS}."
        )
    return _WITH_DEGREE[method](marks, **given)
