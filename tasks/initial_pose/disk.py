"""The disk in the frame: a circle through the edges of brightness, by random sample consensus."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled
from tasks.initial_pose.edges import Edges, values_at
from tasks.initial_pose.settings import LimbSearchSettings

Array = NDArray[np.float64]

# Edges point to the centre within this cosine.
RADIAL_COSINE = 0.85
# How far beside an edge its two sides are looked at, pixels; its bright side also nearer, where a thin crescent is.
BESIDE_PX, NEARER_PX = 5.0, 2.0
# Largest radius, in sizes of the frame: of less of a curve nothing could be measured.
LARGEST_SHARE = 4.0
# Edges cover at least this share of the arc that the limb must have: through less, straight lines are circles, too.
ARC_SHARE = 0.7
# Fewer edges on a circle are none of a limb.
LEAST_EDGES = 6
BEST = 40
# So large a share of the pairs is drawn from edges next to each other, of so many, so that the edges of a small disk
# are not lost among those of a whole frame (Voyager's C1201656: 45 of 1332, of which 6000 pairs drew 7).
NEAR_SHARE, NEAR_EDGES = 0.5, 32
# A second disk counts where so many degrees of it are its own.
SAME_DISK_SHARE = 0.3
# Of a disk that is certainly another: how much of the best one it may cover, and its least score, as shares of its.
OVERLAP, LEAST_SHARE = 0.5, 0.05
# A ring just outside the limb is light of something else where it is brighter than this share of the limb's step.
LIT_SHARE = 0.5


@dataclass(frozen=True)
class Disk:
    """A circle in the frame. centre_px: (2,). score: length of its lit limb, pixels, the brighter the edge and the
    darker the sky beside it the more."""

    centre_px: Array
    radius_px: float
    score: float


def find_disks(edges: Edges, settings: LimbSearchSettings, radius_px: float | None = None) -> list[Disk]:
    """Circles of which much is an edge of brightness that falls outward to a dark sky, the best first, none of them
    almost the same as a better one; empty where there is none. radius_px: of the target, where its range is known.

    Two points of an edge and its direction at each give a circle (random sample consensus: Fischler and Bolles 1981,
    Commun. ACM 24, 381); what is then counted is the length of limb that other edges cover.
    """
    if len(edges.xy_px) < 8:
        return []
    weight = edge_weights(edges, settings.outside_share)
    good = weight > 0
    xy, inward, weight = edges.xy_px[good], edges.inward[good], weight[good]
    if len(xy) < 8:
        return []
    if radius_px is None:
        circles = drawn_circles(xy, inward, weight, edges.clean.shape, settings)
    else:
        # One edge and its direction give a circle of a known radius.
        circles = np.column_stack([xy + radius_px * inward, np.full(len(xy), radius_px)])
    if not len(circles):
        return []
    least_deg = ARC_SHARE * settings.known_arc_deg
    scores = np.array([limb_length(circle, xy, inward, weight, least_deg, settings) for circle in circles])
    found: list[Disk] = []
    order = np.argsort(-scores)
    # Of a small disk the length is small, but the share of it that is seen is not.
    shares = np.argsort(-scores / circles[:, 2])[:BEST]
    for index in [*order[:BEST], *elsewhere(circles, scores, order[BEST:]), *shares]:
        centre, radius = circles[index, :2], float(circles[index, 2])
        score = float(scores[index]) * (1 - lit_outside(edges, centre, radius))
        if score > 0:
            found.append(Disk(centre, radius, score))
    found.sort(key=lambda disk: -disk.score)
    distinct: list[Disk] = []
    for disk in found:
        if all(is_another(disk, other) for other in distinct):
            distinct.append(disk)
    return distinct


def elsewhere(circles: Array, scores: Array, order: NDArray[np.intp]) -> list[int]:
    """Indices, the best first, of circles that are of other disks than the best one's: all of the best may be one."""
    if not len(order):
        return []
    best = circles[int(np.argmax(scores))]
    apart = np.hypot(*(circles[order, :2] - best[:2]).T)
    others = order[(apart > circles[order, 2] + OVERLAP * best[2]) & (scores[order] > LEAST_SHARE * scores.max())]
    return [int(i) for i in others[:BEST]]


def is_another(disk: Disk, other: Disk) -> bool:
    """Whether two circles are of different disks."""
    apart = float(np.hypot(*(disk.centre_px - other.centre_px)))
    larger = max(disk.radius_px, other.radius_px)
    return apart > SAME_DISK_SHARE * larger or abs(disk.radius_px - other.radius_px) > SAME_DISK_SHARE * larger


def edge_weights(edges: Edges, outside_share: float) -> Array:
    """Of each edge (n,), 0 to 1: how strong it is, and how dark its outer side is beside its inner one; 0 where that
    is brighter than `outside_share` of it."""
    outer, inner, nearer = (
        values_at(edges.clean, *(edges.xy_px + beside * edges.inward).T) - edges.dark
        for beside in (-BESIDE_PX, BESIDE_PX, NEARER_PX)
    )
    inner = np.maximum(inner, nearer)
    share = np.clip(outer / np.maximum(inner, 1e-6 * edges.span), 0, 1)
    strong = max(float(np.percentile(edges.strength, 75)), 1e-12)
    weight = np.minimum(edges.strength / strong, 1.0) * (1 - share)
    return np.where(share <= outside_share, weight, 0.0).astype(np.float64)


def drawn_circles(
    xy: Array, inward: Array, weight: Array, shape: tuple[int, ...], settings: LimbSearchSettings
) -> Array:
    """Circles (m, 3), centre and radius, through random pairs of edges whose directions agree with them."""
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(1)
    share = weight / weight.sum()
    i, j = (rng.choice(len(xy), settings.draws, p=share) for _ in range(2))
    near = int(NEAR_SHARE * settings.draws)
    nearest = cKDTree(xy).query(xy, min(NEAR_EDGES + 1, len(xy)))[1]
    j[:near] = nearest[i[:near], rng.integers(1, nearest.shape[1], near)]
    between, turned = xy[i] - xy[j], inward[j] - inward[i]
    square = (turned**2).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = (between * turned).sum(axis=1) / square
    # Directions are good to some degrees; two points near each other say nothing of the radius.
    off = np.linalg.norm(between - radius[:, None] * turned, axis=1)
    largest = LARGEST_SHARE * max(shape)
    usable = (square > 0.02) & (radius > settings.least_radius_px) & (radius < largest)
    usable &= off < 1.0 + 0.15 * np.linalg.norm(between, axis=1)
    i, j, radius = i[usable], j[usable], radius[usable]
    centre = (xy[i] + xy[j] + radius[:, None] * (inward[i] + inward[j])) / 2
    # The radius that both points have from there.
    radius = (np.linalg.norm(xy[i] - centre, axis=1) + np.linalg.norm(xy[j] - centre, axis=1)) / 2
    return np.column_stack([centre, radius])


def limb_length(
    circle: Array, xy: Array, inward: Array, weight: Array, least_deg: float, settings: LimbSearchSettings
) -> float:
    """Length of the circle that edges cover, pixels, each part by the weight of its strongest edge; 0 where they cover
    less than least_deg of it."""
    tolerance = max(settings.tolerance_px, settings.tolerance_share * float(circle[2]))
    return float(covered_px(circle, xy, inward, weight, least_deg, tolerance))


@compiled
def covered_px(circle: Array, xy: Array, inward: Array, weight: Array, least_deg: float, tolerance_px: float) -> float:
    """What `limb_length` says, of the edges within tolerance_px of the circle that point to its centre."""
    radius = circle[2]
    bins = min(max(int(2 * np.pi * radius / 3), 12), 720)
    best = np.zeros(bins)
    radial = 0
    for k in range(len(xy)):
        x, y = xy[k, 0] - circle[0], xy[k, 1] - circle[1]
        distance = np.sqrt(x * x + y * y)
        if abs(distance - radius) >= tolerance_px:
            continue
        if -(x * inward[k, 0] + y * inward[k, 1]) > RADIAL_COSINE * max(distance, 1e-9):
            radial += 1
            place = int((np.arctan2(y, x) / (2 * np.pi) + 0.5) * bins) % bins
            best[place] = max(best[place], weight[k])
    if radial < LEAST_EDGES or np.count_nonzero(best) * 360 / bins < least_deg:
        return 0.0
    return best.sum() * 2 * np.pi * radius / bins


def lit_outside(edges: Edges, centre: Array, radius: float) -> float:
    """Share of a ring just outside the circle, within the frame, that is as bright as half of the step at its limb, or
    more."""
    angle = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    outside, inside = ring(edges, centre, 1.04 * radius + 4, angle), ring(edges, centre, 0.94 * radius - 1, angle)
    farther = ring(edges, centre, 1.08 * radius + 6, angle)
    both = np.isfinite(outside) & np.isfinite(inside)
    if not both.any():
        return 1.0
    step = inside[both] - outside[both]
    lit = step >= np.percentile(step, 70)
    dark, bright = float(np.median(outside[both][lit])), float(np.median(inside[both][lit]))
    around = np.concatenate([outside, farther])
    around = around[np.isfinite(around)]
    return float((around > dark + LIT_SHARE * max(bright - dark, 0.0)).mean())


def ring(edges: Edges, centre: Array, radius: float, angle: Array) -> Array:
    """Brightness (n,) at position angles (n,) of a circle, NaN outside the frame."""
    ny, nx = edges.clean.shape
    x, y = centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)
    inside = (x >= 0) & (y >= 0) & (x <= nx - 1) & (y <= ny - 1)
    return np.where(inside, values_at(edges.clean, x, y), np.nan)
