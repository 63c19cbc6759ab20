"""General two-variable polynomial (the paper's method 2, equation 4)."""

import numpy as np
from numpy.typing import NDArray

from tasks.undistort.error_map import error_map_of
from tasks.undistort.least_squares import weighted_fit
from tasks.undistort.mark_set import FitReport, MarkSet
from tasks.undistort.model import Points
from tasks.undistort.polynomial_basis import legendre_matrix
from tasks.undistort.smooth_model import SmoothModel

DEFAULT_DEGREE = 6  # the paper's best


def fit_polynomial(marks: MarkSet, degree: int = DEFAULT_DEGREE) -> SmoothModel:
    """Undistorted x and y as polynomials of total degree `degree` in raw x and y, by least squares over all marks.

    Equation 4 in normalised coordinates and Legendre's basis, which spans the same functions and keeps the system far
    from singular. Raises RefusedError when the degree is too high for the marks.
    """
    design = legendre_matrix(marks.raw_xy, degree, marks.raw_size_px)
    fit = weighted_fit(design, marks.object_xy, marks.sigma_px, f"a polynomial of degree {degree}")
    found, coefficients, raw_size_px = marks.found, fit.coefficients, marks.raw_size_px

    def forward(raw: Points) -> Points:
        return np.asarray(legendre_matrix(raw, degree, raw_size_px) @ coefficients)

    report = FitReport(
        "polynomial", marks.object_xy[found], fit.residual[found], fit.leave_one_out[found], fit.condition_number
    )
    return SmoothModel("polynomial", marks, forward, error_map_of(report), report, degree)


def monomial_condition_number(marks: MarkSet, degree: int = DEFAULT_DEGREE) -> float:
    """Condition number of equation 4 as the paper writes it, in powers of pixels: what makes it 'close to singular'."""
    x, y = marks.raw_xy.T
    columns: list[NDArray[np.float64]] = [x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)]
    return float(np.linalg.cond(np.stack(columns, axis=1)))
