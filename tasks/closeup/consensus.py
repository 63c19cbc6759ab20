"""Which motion of the camera do the patches agree on, and could it be chance?

All patches' correlations are added up under each roll and range of a grid, displaced as these displace each patch
(a Hough transform with the correlations as votes). In the sum, what the patches have in common stands out. Its scatter
away from the peak is what chance gives, with all that neighbouring patches have in common.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from tasks.closeup.motion import RANGE, ROLL
from tasks.closeup.patches import Surfaces

Array = NDArray[np.float64]

# Steps of the grid of rolls and ranges: they move no patch by more than this, px.
GRID_STEP_PX = 1.5
MOST_STEPS = 15
# Within so much of the peak, px, the sum belongs to it.
OWN_PEAK_PX = 4
LARGEST_CORRELATION = 0.99


@dataclass(frozen=True)
class Consensus:
    """step: (7,) the motion, see `closeup.motion`. height: of the sum there, in sigmas of what chance gives.
    independent: how many independent places the search held; places: how many it looked at. false_alarm: probability
    that chance gives as much anywhere in the search. rival: the next highest sum, in the same sigmas."""

    step: Array
    height: float
    independent: float
    places: int
    false_alarm: float
    rival: float


def grid(sigma: float, most: float, sigmas: float, response_px: float) -> Array:
    """Values that are tried of an unknown: to so many sigmas of its prior and no farther than `most`; response_px: by
    how much a unit of it moves the patch that it moves most."""
    reach = min(sigmas * sigma, most)
    steps = min(int(np.ceil(reach * response_px / GRID_STEP_PX)), MOST_STEPS // 2)
    return np.linspace(-reach, reach, 2 * steps + 1) if steps else np.zeros(1)


def agreed(
    surfaces: Surfaces, response: Array, rolls: Array, ranges: Array, reach_px: int, search_px: int
) -> Consensus:
    """The motion at which the correlations' sum is highest.

    response: (n, 2, 7), see `responses`. search_px: of the displacement that all have in common. reach_px: how far the
    sum is computed to learn its scatter; the patches' own search reaches as much farther as rolls and ranges move them.
    """
    votes = standardised(surfaces.correlation)
    width = 2 * reach_px + 1
    extra = surfaces.reach_px - reach_px
    near = slice(max(reach_px - search_px, 0), reach_px + search_px + 1)
    best, looked_at = None, 0
    for roll, far in product(rolls, ranges):
        # What moves in the image by d is found in the map's picture at -d.
        own = -np.rint(response[:, :, ROLL] * roll + response[:, :, RANGE] * far).astype(int)
        own = np.clip(own, -extra, extra)
        total = np.zeros((width, width))
        for vote, (dx, dy) in zip(votes, own, strict=True):
            total += vote[extra + dy : extra + dy + width, extra + dx : extra + dx + width]
        searched = total[near, near]
        looked_at += searched.size
        y, x = (int(k) + near.start for k in np.unravel_index(np.argmax(searched), searched.shape))
        if best is None or total[y, x] > best[0]:
            best = float(total[y, x]), np.array([reach_px - x, reach_px - y, roll, far, 0, 0, 0]), total, (y, x)
    if best is None:
        raise ValueError("a grid without rolls or ranges")
    peak, step, total, place = best
    rows, columns = np.indices(total.shape)
    away = np.hypot(rows - place[0], columns - place[1]) > OWN_PEAK_PX
    mean, sigma = float(total[away].mean()), float(total[away].std())
    independent = independent_places(np.where(away, total - mean, 0))
    height = float((peak - mean) / max(sigma, 1e-9))
    rival = float((total[away].max() - mean) / max(sigma, 1e-9))
    return Consensus(step, height, independent, looked_at, chance(height, independent, looked_at), rival)


def standardised(correlation: NDArray) -> Array:
    """Fisher's transform of correlations (n, ny, nx), in units of each patch's own scatter over the search."""
    votes = np.arctanh(np.clip(correlation.astype(np.float64), -LARGEST_CORRELATION, LARGEST_CORRELATION))
    votes -= votes.mean(axis=(1, 2), keepdims=True)
    return np.asarray(votes / np.maximum(votes.std(axis=(1, 2), keepdims=True), 1e-9))


def independent_places(values: Array) -> float:
    """How many independent values a field (ny, nx) of mean 0 holds: its area over the integral of its squared
    autocorrelation (Bayley and Hammersley 1946, J. R. Stat. Soc. Suppl. 8, 184)."""
    size = [2 * n for n in values.shape]
    power = np.abs(np.fft.rfft2(values, size)) ** 2
    covariance = np.fft.irfft2(power, size)
    if covariance[0, 0] <= 0:
        return 1.0
    return float(max(values.size / np.sum((covariance / covariance[0, 0]) ** 2), 1.0))


def chance(height: float, independent: float, places: int) -> float:
    """Probability that the largest of `places` sums is so high by chance: Student's distribution for a scatter that
    is itself measured on so many independent places, and Bonferroni's bound for all that was looked at."""
    from scipy.stats import t

    return float(min(1.0, places * t.sf(height, max(independent - 1, 1.0))))
