"""Identification of star images without knowing where the camera looks: pairs of detections against pairs of catalog
stars of the same separation; each such pair is an orientation, which the other detections support or not.

The probability that chance does as much is the number of orientations tried times the binomial probability that so many
of the other detections have a catalog star near, at the catalog's own density there.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Array = NDArray[np.float64]
FIRST_LOOK = 8  # detections that are compared first; orientations that none of them supports are dropped
LARGEST_BATCH = 200_000


@dataclass(frozen=True)
class SkyPairs:
    """Catalog stars (n, 3) and their pairs: first, second: (m,) star numbers; angle_rad: (m,) ascending."""

    directions: Array
    first: NDArray[np.int32]
    second: NDArray[np.int32]
    angle_rad: Array
    tree: "cKDTree"


@dataclass(frozen=True)
class Hypothesis:
    """An orientation that detections support. matches: how many, with the two that it was made of. chance: binomial
    probability of as many for one orientation; tried: how many orientations were tried until then."""

    camera_from_sky: Array
    matches: int
    chance: float
    tried: int

    @property
    def false_alarm(self) -> float:
        """Probability that any of the orientations tried would be borne out so well by chance."""
        return min(1.0, self.chance * self.tried)


def sky_pairs(directions: Array, widest_rad: float) -> SkyPairs:
    """All pairs of stars (n, 3) up to a separation."""
    from scipy.spatial import cKDTree

    tree = cKDTree(directions)
    pairs = tree.query_pairs(2 * np.sin(widest_rad / 2), output_type="ndarray").astype(np.int32)
    chord = np.linalg.norm(directions[pairs[:, 0]] - directions[pairs[:, 1]], axis=1)
    angle = 2 * np.arcsin(np.clip(chord / 2, 0, 1))
    order = np.argsort(angle)
    return SkyPairs(directions, pairs[order, 0], pairs[order, 1], angle[order], tree)


def frames(a: Array, b: Array) -> Array:
    """Right-handed frames (..., 3, 3), rows the axes, that two directions (..., 3) span: their middle, and across."""
    middle = a + b
    middle = middle / np.linalg.norm(middle, axis=-1, keepdims=True)
    normal = np.cross(a, b)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.stack([middle, np.cross(normal, middle), normal], axis=-2)


def hypotheses(
    rays: Array, stars: SkyPairs, tolerance_rad: float, scale_error: float, least_rad: float, possible: "Possible"
) -> Iterator[Hypothesis]:
    """The best orientation of each pair of detections, pairs of bright detections first. rays: (k, 3) unit vectors in
    the camera frame, brightest first. scale_error: relative, of separations. least_rad: pairs closer than this fix no
    roll and are left out."""
    tried = 0
    widest = float(stars.angle_rad[-1]) if len(stars.angle_rad) else 0.0
    for i, j in brightest_pairs(len(rays)):
        angle = 2 * np.arcsin(np.clip(np.linalg.norm(rays[i] - rays[j]) / 2, 0, 1))
        if not least_rad <= angle <= widest:
            continue
        slack = 1.5 * tolerance_rad + scale_error * angle
        low, high = np.searchsorted(stars.angle_rad, [angle - slack, angle + slack])
        others = [k for k in range(len(rays)) if k not in (i, j)]
        best = None
        for begin in range(low, high, LARGEST_BATCH):
            chosen = slice(begin, min(begin + LARGEST_BATCH, high))
            turned = _orientations(rays[i], rays[j], stars, chosen)
            turned = turned[possible(turned)]
            tried += len(turned)
            found = _borne_out(turned, rays[others], stars, tolerance_rad)
            if found is not None and (best is None or found[1] > best[1]):
                best = found
        if best is not None:
            chance = chance_of(best[1], len(others), _density(best[0], rays, stars) * np.pi * tolerance_rad**2)
            yield Hypothesis(best[0], best[1] + 2, chance, tried)
        else:
            yield Hypothesis(np.eye(3), 0, 1.0, tried)


class Possible:
    """Which orientations come into question. axis: (3,) that the boresight may be `within_rad` of; predicted:
    camera_from_sky that the orientation may differ from by as much. None: any."""

    def __init__(self, within_rad: float = np.pi, axis: Array | None = None, predicted: Array | None = None) -> None:
        self.within_rad, self.axis, self.predicted = within_rad, axis, predicted

    def __call__(self, turned: Array) -> NDArray[np.bool_]:
        """Whether each of (n, 3, 3) camera_from_sky does."""
        if self.predicted is not None:
            trace = turned.reshape(-1, 9) @ self.predicted.ravel()
            return np.asarray(np.arccos(np.clip((trace - 1) / 2, -1, 1)) <= self.within_rad)
        if self.axis is not None:
            return np.asarray(turned[:, 2] @ self.axis >= np.cos(self.within_rad))
        return np.ones(len(turned), bool)


def brightest_pairs(count: int) -> list[tuple[int, int]]:
    """Pairs (i, j) of the first detections, i < j, those with the brighter fainter one first."""
    return sorted(((i, j) for j in range(count) for i in range(j)), key=lambda pair: (pair[1], pair[0]))


def chance_of(matches: int, detections: int, probability: float) -> float:
    """Probability that at least `matches` of `detections` have a catalog star near by chance."""
    from scipy.stats import binom

    return float(binom.sf(matches - 1, detections, min(max(probability, 1e-12), 1.0)))


def _orientations(a: Array, b: Array, stars: SkyPairs, chosen: slice) -> Array:
    """camera_from_sky (2 m, 3, 3) that bring pairs of stars, either way round, to two rays."""
    of_camera = frames(a, b)
    one, two = stars.directions[stars.first[chosen]], stars.directions[stars.second[chosen]]
    of_sky = frames(one, two)
    other_way = of_sky * np.array([1.0, -1.0, -1.0])[:, None]  # frames(two, one)
    return np.asarray(of_camera.T @ np.concatenate([of_sky, other_way]))


def _borne_out(turned: Array, rays: Array, stars: SkyPairs, tolerance_rad: float) -> tuple[Array, int] | None:
    """The orientation that most rays have a star for, and how many; None where no ray of the first few has one."""
    if not len(turned):
        return None
    seen = np.zeros(len(turned), dtype=int)
    alive = np.arange(len(turned))
    for begin in (0, FIRST_LOOK):
        for ray in rays[begin : FIRST_LOOK if begin == 0 else None]:
            near, _ = stars.tree.query(turned[alive].transpose(0, 2, 1) @ ray, distance_upper_bound=tolerance_rad)
            seen[alive] += np.isfinite(near)
        alive = alive[seen[alive] > 0]
        if not len(alive):
            return None
    best = int(alive[np.argmax(seen[alive])])
    return turned[best], int(seen[best])


def _density(camera_from_sky: Array, rays: Array, stars: SkyPairs) -> float:
    """Stars per steradian where the rays point to."""
    middle = rays.mean(axis=0)
    middle = middle / np.linalg.norm(middle)
    reach = float(np.arccos(np.clip(rays @ middle, -1, 1)).max()) * 1.1
    count = len(stars.tree.query_ball_point(camera_from_sky.T @ middle, 2 * np.sin(reach / 2)))
    return max(count, 1) / (2 * np.pi * (1 - np.cos(reach)))
