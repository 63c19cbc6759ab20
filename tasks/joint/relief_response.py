"""What a surface that lies elsewhere than the ellipsoid's does to the solution.

The limb is displaced outward by one pixel, one arc after the other, and the step that the solution would take is found
from its last linear problem (considered parameters; Bierman 1977, Factorization Methods, chapter VIII). How far the
interior holds the solution against its limb, and which direction a short lit arc leaves open, is thereby accounted for.
Markings are displaced as well: those of a surface that is higher by a pixel lie farther from the disk's middle by the
sine of the emission angle. Patches of the face rise and fall one after the other, each on its own.
"""

import numpy as np
from numpy.typing import NDArray

from tasks.compare.limb_errors import RELIEF_ARC_DEG
from tasks.joint.gauss_newton import Solution
from tasks.joint.normal_equations import scaled_inverse
from tasks.joint.parameters import ATTITUDE, NAMES, OFFSET
from tasks.joint.tiles import LOCAL

Array = NDArray[np.float64]

MOVING = slice(-len(NAMES), None)
ARCS = round(360 / RELIEF_ARC_DEG)
# Patches of the face as wide as the arcs: rings of emission angle, from the middle out, and each ring's sectors.
RING_DEG = np.array([30.0, 50.0, 70.0])
SECTORS = np.array([6, 12, 18, 18])
FIRST = np.concatenate([[0], np.cumsum(SECTORS)])
# Markings this near to the limb are narrower than the blur.
MOST_EMISSION_DEG = 80.0


def relief_response(solution: Solution) -> Array:
    """The step (8, arcs + patches) that the solution takes when one arc of the limb, of RELIEF_ARC_DEG, lies a pixel
    farther out, and when one patch of the face is higher by a pixel, for each of them; nothing for what is dark,
    outside the frame or unusable. Pixels are the solution's."""
    problem = solution.problem
    parts = (_limb_pixels(solution), _face_pixels(solution))
    y, x, label, moved = (np.concatenate(each) for each in zip(*parts, strict=True))
    pulled = np.asarray(solution.fit.weight[y, x] * moved, np.float64)
    count = ARCS + int(FIRST[-1])
    direct = np.stack([np.bincount(label, pulled * column[y, x], count) for column in problem.columns])
    right = direct - _through_tiles(solution, y, x, label, pulled, count)
    step = (scaled_inverse(solution.fit.normal) @ right)[MOVING]
    step[solution.held] = 0
    return np.asarray(step)


def _limb_pixels(solution: Solution) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array]:
    """Rows and columns (n,) of the limb's pixels, the arc that each is in, and what it changes by when that lies a
    pixel farther out."""
    model = solution.model
    least = solution.given.thresholds.variance.limb_cover
    y, x = np.nonzero((model.coverage > least) & (model.coverage < 1 - least) & (solution.fit.weight > 0))
    slope = np.asarray(np.gradient(model.coverage), np.float64)
    outward = -slope[::-1, y, x]
    outward /= np.maximum(np.hypot(*outward), 1e-12)
    angle_deg = np.degrees(np.arctan2(y - model.centre_px[1], x - model.centre_px[0])) % 360
    per_x, per_y = solution.problem.columns[MOVING][OFFSET]
    moved = per_x[y, x] * outward[0] + per_y[y, x] * outward[1]
    return y, x, np.minimum((angle_deg // RELIEF_ARC_DEG).astype(np.int64), ARCS - 1), moved


def _face_pixels(solution: Solution) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array]:
    """The same of the pixels inside the limb, and the patch that each is in, counted after the arcs. The markings alone
    move, as by a turn of the body there about the axis across the way to the middle."""
    model, pose = solution.model, solution.state.pose
    inside = (model.coverage >= 1 - solution.given.thresholds.variance.limb_cover) & (solution.fit.weight > 0)
    y, x = np.nonzero(inside)
    away_px = np.stack([x - model.centre_px[0], y - model.centre_px[1]], axis=1)
    emission_deg, turn_deg = raising_turn(away_px, model.tiles.radius_px, pose.camera_from_body)
    per_turn = solution.problem.columns[MOVING][ATTITUDE]
    moved = sum(part * column[y, x] for part, column in zip(turn_deg.T, per_turn, strict=True))
    ring = np.searchsorted(RING_DEG, emission_deg)
    share = np.arctan2(away_px[:, 1], away_px[:, 0]) / (2 * np.pi) % 1
    sector = np.minimum((share * SECTORS[ring]).astype(np.int64), SECTORS[ring] - 1)
    return y, x, ARCS + FIRST[ring] + sector, moved


def raising_turn(away_px: Array, radius_px: float, camera_from_body: Array) -> tuple[Array, Array]:
    """Emission angle (n,), degrees, at most MOST_EMISSION_DEG, of places away_px (n, 2) from the middle of a disk, and
    the turn (n, 3) of the body, a rotation vector in its frame, degrees, that moves the surface there outward in the
    picture as one that is higher by a pixel is seen."""
    away = np.maximum(np.hypot(*away_px.T), 1e-6)
    emission = np.arcsin(np.minimum(away / radius_px, np.sin(np.radians(MOST_EMISSION_DEG))))
    axis = np.stack([away_px[:, 1] / away, -away_px[:, 0] / away, np.zeros_like(away)], axis=1)
    turn_deg = np.degrees(np.tan(emission) / radius_px)[:, None] * (axis @ camera_from_body)
    return np.degrees(emission), np.asarray(turn_deg)


def _through_tiles(
    solution: Solution,
    y: NDArray[np.int64],
    x: NDArray[np.int64],
    label: NDArray[np.int64],
    pulled: Array,
    count: int,
) -> Array:
    """The part of the pull of arcs and patches on the columns (n, count) that the tiles' own unknowns take up."""
    tiles = solution.problem.tiles
    tile = tiles.label[y, x]
    inside = tile >= 0
    place = tile[inside] * count + label[inside]
    local = solution.problem.local[:, y, x][:, inside].astype(np.float64)
    own = [np.bincount(place, pulled[inside] * column, tiles.count * count) for column in local]
    by_tile = np.stack(own).reshape(LOCAL, tiles.count, count)
    return np.asarray(np.einsum("tln,ltc->nc", solution.fit.by_others, by_tile))
