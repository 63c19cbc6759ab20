"""Radial polynomial (the paper's method 1, equation 2)."""

import numpy as np
from numpy.typing import NDArray

from tasks.undistort.error_map import error_map_of
from tasks.undistort.least_squares import Fit, weighted_fit
from tasks.undistort.mark_set import FitReport, MarkSet
from tasks.undistort.model import Points
from tasks.undistort.smooth_model import SmoothModel

DEFAULT_DEGREE = 9  # the paper's best

Array = NDArray[np.float64]


def fit_radial(marks: MarkSet, degree: int = DEFAULT_DEGREE) -> SmoothModel:
    """Undistorted offset = raw offset times f(r) = k0 + k1 r + ... + k_degree r^degree, by least squares; both
    coordinates of all marks share the k_i (equations 2 and 3).

    Offsets count from the frames' centres; k0, 1 in the paper, is solved because the two frames differ in scale. The
    powers of r are orthogonalised (Legendre on [0, 1], r in units of the half diagonal). Raises RefusedError when the
    degree is too high for the marks.
    """
    raw_centre, centre = ((np.asarray(size) - 1.0) / 2.0 for size in (marks.raw_size_px, marks.size_px))
    half_diagonal = float(np.hypot(*raw_centre))
    offset = marks.raw_xy - raw_centre
    design = _design(offset, degree, half_diagonal)
    wanted = (marks.object_xy - centre).reshape(-1, 1)
    fit = weighted_fit(design, wanted, np.repeat(marks.sigma_px, 2), f"a radial polynomial of degree {degree}")
    coefficients = fit.coefficients

    def forward(raw: Points) -> Points:
        offset = raw - raw_centre
        return centre + (_design(offset, degree, half_diagonal) @ coefficients).reshape(offset.shape)

    report = _report(fit, marks, design, wanted)
    return SmoothModel("radial", marks, forward, error_map_of(report), report, degree)


def _design(offset: Array, degree: int, half_diagonal: float) -> Array:
    r = np.hypot(offset[:, 0], offset[:, 1]) / half_diagonal
    powers = np.polynomial.legendre.legvander(2.0 * r - 1.0, degree)
    return np.asarray((offset[:, :, None] * powers[:, None, :]).reshape(2 * len(offset), degree + 1) / half_diagonal)


def _report(fit: Fit, marks: MarkSet, design: Array, wanted: Array) -> FitReport:
    """Leaving out a mark leaves out two equations: its errors are (I - H_ii)^-1 e_i with the 2x2 block of the hat."""
    weighted = design / np.repeat(marks.sigma_px, 2)[:, None]
    u = np.linalg.svd(weighted, full_matrices=False)[0].reshape(len(marks.found), 2, -1)
    hat = u @ np.swapaxes(u, 1, 2)
    residual = (design @ fit.coefficients - wanted).reshape(-1, 2)
    leave_one_out = np.linalg.solve(np.eye(2) - hat, residual[..., None])[..., 0]
    found = marks.found
    return FitReport("radial", marks.object_xy[found], residual[found], leave_one_out[found], fit.condition_number)


def radial_rmsd_from_corner(marks: MarkSet, degree: int = DEFAULT_DEGREE) -> float:
    """RMSD of equation 2 taken literally: r counted from pixel (0, 0) of the image, k0 = 1.

    It gives 16.6-22.5 px for the four Voyager cameras, the paper's 17.3 px; about the frame's centre the same
    polynomial leaves 4-8 px.
    """
    offset, wanted = marks.raw_xy[marks.found] + 1.0, marks.object_xy[marks.found] + 1.0
    r = np.hypot(offset[:, 0], offset[:, 1]) / max(marks.size_px)
    powers = np.stack([r**power for power in range(1, degree + 1)], axis=1)
    design = (offset[:, :, None] * powers[:, None, :]).reshape(-1, degree)
    target = (wanted - offset).ravel()
    residual = (design @ np.linalg.lstsq(design, target, rcond=None)[0] - target).reshape(-1, 2)
    return float(np.sqrt((residual**2).sum(axis=1).mean()))
