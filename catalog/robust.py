"""Robust statistics that all fits share: a scatter that outliers do not raise, and the weights that they get.

Huber, Robust Statistics (1981): squares up to a limit, straight lines beyond it.
"""

import numpy as np
from numpy.typing import NDArray

# A normal distribution's standard deviation over its median absolute deviation.
MAD_TO_SIGMA = 1.482602218505602
LEAST_SIZE = 1e-12


def sigma_about_zero(values: NDArray) -> float:
    """Standard deviation of errors (any shape) whose mean is known to be zero, by the median of their sizes; NaN for
    none."""
    return float(MAD_TO_SIGMA * np.median(np.abs(values)))


def sigma_about_median(values: NDArray) -> float:
    """Standard deviation of values (any shape) by their median absolute deviation; NaN for none."""
    return sigma_about_zero(values - np.median(values))


def huber_weight(size: NDArray, limit: float | NDArray) -> NDArray:
    """Factors by which the weights of residuals of this size (any shape, 0 and above) are lowered: 1 up to the limit,
    limit / size beyond. They have the type of `size`."""
    return np.minimum(1.0, limit / np.maximum(size, LEAST_SIZE))
