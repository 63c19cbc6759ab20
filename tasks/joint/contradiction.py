"""When estimates of the same thing contradict each other, and how much larger their errors must then be."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# No factor is larger: beyond it nothing is known.
MOST = 1e6


def chi_square(freedom: int, chance: float) -> float:
    """The weighted square that so many differences exceed with the probability `chance`."""
    from scipy.special import chdtri

    return float(chdtri(freedom, chance))


def growth_of(own: Array, others: Array, wanted: Array) -> float:
    """The least factor, 1 or more, on the covariance `own` (n, n) with which differences `wanted` (n,) from what others
    tell, of covariance `others`, are no surprise: their weighted square is their number."""
    from scipy.optimize import brentq

    def surprise(log_factor: float) -> float:
        return float(wanted @ np.linalg.solve(np.exp(log_factor) * own + others, wanted)) - len(wanted)

    most = np.log(MOST)
    if surprise(0.0) <= 0:
        return 1.0
    return float(np.exp(brentq(surprise, 0.0, most, xtol=1e-3))) if surprise(most) < 0 else MOST
