"""The methods that fit a distortion model to marks, by name and behind one signature."""

from collections.abc import Callable
from typing import Any

from catalog.errors import RefusedError
from tasks.undistort.delaunay import DelaunayModel
from tasks.undistort.mark_set import MarkSet
from tasks.undistort.polynomial import fit_polynomial
from tasks.undistort.radial import fit_radial
from tasks.undistort.smooth_model import SmoothModel
from tasks.undistort.thin_plate import fit_thin_plate

FittedModel = SmoothModel | DelaunayModel

_WITH_DEGREE: dict[str, Callable[..., SmoothModel]] = {
    "radial": fit_radial,
    "polynomial": fit_polynomial,
    "thin-plate": fit_thin_plate,
}
METHODS = ("radial", "polynomial", "delaunay", "thin-plate")


def fit_model(method: str, marks: MarkSet, degree: int | None = None) -> FittedModel:
    """Fit `method` (one of `METHODS`) to the marks; degree None is the method's default.

    Raises RefusedError when the marks are too few, collinear or out of order, or the degree is too high for them.
    """
    if method == "delaunay":
        return DelaunayModel(marks)
    if method not in _WITH_DEGREE:
        raise RefusedError("method-unknown", f"no distortion method is called {method!r}.", f"Use one of {METHODS}.")
    given: dict[str, Any] = {} if degree is None else {"degree": degree}
    return _WITH_DEGREE[method](marks, **given)
