"""Weighted linear least squares with residuals, leave-one-out errors and condition number in one go."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason

WORST_CONDITION = 1e10
FULL_LEVERAGE = 1.0 - 1e-9

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """coefficients (terms, k). residual, leave_one_out (n, k): fitted minus given value with and without that row, by
    the hat matrix: e_i / (1 - h_i). condition_number: of the weighted design matrix."""

    coefficients: Array
    residual: Array
    leave_one_out: Array
    condition_number: float


def weighted_fit(design: Array, values: Array, sigma: Array, what: str) -> Fit:
    """Minimise sum ((design @ c - values) / sigma)^2. design (n, terms), values (n, k), sigma (n,).

    `what` names the fit in the RefusedError that is raised when the system has too few rows or is close to singular.
    """
    rows, terms = design.shape
    if rows <= terms:
        raise RefusedError(
            Reason.DEGREE_TOO_HIGH,
            f"{what} has {terms} coefficients, but there are only {rows} marks.",
            "Lower the degree or use more marks.",
        )
    weighted = design / sigma[:, None]
    u, s, vt = np.linalg.svd(weighted, full_matrices=False)
    condition = float(s[0] / s[-1]) if s[-1] > 0 else float("inf")
    if condition > WORST_CONDITION:
        raise RefusedError(
            Reason.DEGREE_TOO_HIGH,
            f"{what} cannot be determined from the marks: its system has the condition number {condition:.1e}.",
            "Lower the degree, or use marks that cover the frame.",
        )
    coefficients = vt.T @ ((u.T @ (values / sigma[:, None])) / s[:, None])
    residual = design @ coefficients - values
    leverage = np.minimum((u**2).sum(axis=1), FULL_LEVERAGE)
    return Fit(coefficients, residual, residual / (1.0 - leverage)[:, None], condition)
