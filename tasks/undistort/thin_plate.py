"""Thin-plate spline on a polynomial trend: smooth, close to every mark, and the best predictor of a mark left out."""

import numpy as np

from tasks.undistort.error_map import ErrorMap
from tasks.undistort.mark_set import FitReport, MarkSet
from tasks.undistort.model import Points
from tasks.undistort.smooth_model import SmoothModel
from tasks.undistort.smooth_surface import SMOOTHING, SmoothSurface

DEFAULT_DEGREE = 7


def fit_thin_plate(marks: MarkSet, degree: int = DEFAULT_DEGREE, smoothing: float = SMOOTHING) -> SmoothModel:
    """Undistorted x and y as smoothing thin-plate splines of raw x and y.

    The trend takes the smooth distortion of the tube (pincushion of the electron optics, S-shaped deflection), the
    spline what bends around bright areas (beam bending). Raises RefusedError when the degree is too high.
    """
    surface = SmoothSurface(
        marks.raw_xy, marks.object_xy, marks.sigma_px, marks.raw_size_px, degree, smoothing, assessed=marks.found
    )
    return plate_of_surface(marks, surface, degree)


def plate_of_surface(marks: MarkSet, surface: SmoothSurface, degree: int) -> SmoothModel:
    """The model whose forward map is `surface`, with its errors at the found marks."""
    found = marks.found
    report = FitReport(
        "thin-plate",
        marks.object_xy[found],
        -surface.residual[found],
        -surface.leave_one_out[found],
        surface.condition_number,
    )
    local = ErrorMap(marks.object_xy[found], (surface.standardised[found] ** 2).mean(axis=1))
    overall = float(np.sqrt((surface.standardised[found] ** 2).mean()))

    def sigma_px(points: Points) -> Points:
        """The kriging error, scaled by how surprising the nearby marks were."""
        raw = model.distort_points(points)
        return np.asarray(surface.sigma_at(raw) * local(points) / overall)

    model = SmoothModel("thin-plate", marks, surface, sigma_px, report, degree)
    return model
