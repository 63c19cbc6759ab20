"""What a limb that lies elsewhere than the ellipsoid's does to the solution.

The limb is displaced outward by one pixel, one arc after the other, and the step that the solution would take is found
from its last linear problem (considered parameters; Bierman 1977, Factorization Methods, chapter VIII). How far the
interior holds the solution against its limb, and which direction a short lit arc leaves open, is thereby accounted for.
"""

import numpy as np
from numpy.typing import NDArray

from tasks.compare.limb_errors import RELIEF_ARC_DEG
from tasks.joint.gauss_newton import Solution
from tasks.joint.normal_equations import scaled_inverse
from tasks.joint.parameters import NAMES, OFFSET
from tasks.joint.tiles import LOCAL

Array = NDArray[np.float64]


def limb_response(solution: Solution) -> Array:
    """The step (8, arcs) that the solution takes when one arc of the limb lies a pixel farther out, for every arc of
    RELIEF_ARC_DEG; nothing for arcs that are dark, outside the frame or unusable. Pixels are the solution's."""
    moving = slice(-len(NAMES), None)
    y, x, arc, outward = _limb_pixels(solution)
    columns = solution.problem.columns[:, y, x].astype(np.float64)
    per_x, per_y = columns[moving][OFFSET]
    pulled = solution.fit.weight[y, x] * (per_x * outward[0] + per_y * outward[1])
    count = round(360 / RELIEF_ARC_DEG)
    direct = np.stack([np.bincount(arc, pulled * column, count) for column in columns])
    right = direct - _through_tiles(solution, y, x, arc, pulled, count)
    step = (scaled_inverse(solution.fit.normal) @ right)[moving]
    step[solution.held] = 0
    return np.asarray(step)


def _limb_pixels(solution: Solution) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array]:
    """Rows and columns (n,) of the limb's pixels, the arc that each is in, and the outward direction (2, n)."""
    model = solution.model
    least = solution.given.thresholds.variance.limb_cover
    y, x = np.nonzero((model.coverage > least) & (model.coverage < 1 - least) & (solution.fit.weight > 0))
    slope = np.asarray(np.gradient(model.coverage), np.float64)
    outward = -slope[::-1, y, x]
    outward /= np.maximum(np.hypot(*outward), 1e-12)
    angle_deg = np.degrees(np.arctan2(y - model.centre_px[1], x - model.centre_px[0])) % 360
    return y, x, np.minimum((angle_deg // RELIEF_ARC_DEG).astype(np.int64), round(360 / RELIEF_ARC_DEG) - 1), outward


def _through_tiles(
    solution: Solution,
    y: NDArray[np.int64],
    x: NDArray[np.int64],
    arc: NDArray[np.int64],
    pulled: Array,
    count: int,
) -> Array:
    """The part of the arcs' pull on the columns (n, count) that the tiles' own unknowns take up."""
    tiles = solution.problem.tiles
    label = tiles.label[y, x]
    inside = label >= 0
    place = label[inside] * count + arc[inside]
    local = solution.problem.local[:, y, x][:, inside].astype(np.float64)
    own = [np.bincount(place, pulled[inside] * column, tiles.count * count) for column in local]
    by_tile = np.stack(own).reshape(LOCAL, tiles.count, count)
    return np.asarray(np.einsum("tln,ltc->nc", solution.fit.by_others, by_tile))
