"""When estimates of the same thing contradict each other, how much larger their errors must then be, and how large what
they show in common is."""

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


def size_of(found: Array, noise: Array, passed: Array, expected: float, chance: float) -> float:
    """1-sigma of what terms (n,) have in common, by moments: each is found with the variance `noise` (n,) plus
    `passed` (n,) times the variance sought, and weighted by what its square tells of that: terms that the image hardly
    shows, whose noise their prior keeps small, would else drown the others in chance. 0 where the surplus is below
    `chance` times its own scatter."""
    weight = passed / (noise + passed * expected**2) ** 2
    surplus = float(weight @ (found**2 - noise))
    by_chance = float(np.sqrt(2 * weight**2 @ noise**2))
    return float(np.sqrt(surplus / (weight @ passed))) if surplus > chance * by_chance else 0.0
