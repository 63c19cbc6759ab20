"""How well limb edges tell centre and range: neighbouring edges err together, and a short arc leaves a direction open.

An arc of limb fixes the centre across it well and along it hardly, and trades the centre against the range along its
bisector. The full covariance of centre and range says so; single sigmas do not.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Lengths of limb over which segments may err together, degrees; the one that shows most of it counts.
ARCS_DEG = (2, 4, 8, 12, 16, 20, 30)
# Whatever their scatter, by so much do edges err together along an arc of the largest length: blur, laws, markings.
EDGE_PX = 0.05
# Relief is taken to be the same over so much of a limb, degrees: nine parts of a half-lit one.
RELIEF_ARC_DEG = 20
# Neighbouring segments share pixels of the blur: so many of them count as one measurement.
CORRELATED_SEGMENTS = 3.0
FEWEST_IN_ARC = 3


def directions_deg(away_px: Array) -> Array:
    """Position angle (n,) of limb points away_px (n, 2) from the disk's centre, 0 to 360."""
    return np.asarray(np.degrees(np.arctan2(away_px[:, 1], away_px[:, 0])) % 360)


def limb_covariance(design: Array, residual: Array, weight: Array, angle_deg: Array) -> Array:
    """Covariance (m, m) of a fit of design (n, m) to limb edges by weight (n,), with residual (n,) px left at the
    position angles angle_deg (n,): segments that err together along an arc count as one."""
    kept = weight * residual
    free = max(len(kept) - design.shape[1], 1)
    together = shared_along(kept, angle_deg)
    variance = max(float(kept @ kept) / free * together, EDGE_PX**2 * segments_per_arc(angle_deg))
    inverse = np.linalg.pinv((design * weight[:, None]).T @ design, hermitian=True)
    return np.asarray(inverse * variance)


def shared_along(residual: Array, angle_deg: Array) -> float:
    """How many neighbouring segments err together: the largest mean square of sums over arcs, by the sum of squares."""
    squares = max(float(residual @ residual), 1e-300)
    sums = (np.bincount((angle_deg // arc).astype(np.int64), residual) for arc in ARCS_DEG)
    return max(1.0, *(float(s @ s) / squares for s in sums))


def segments_per_arc(angle_deg: Array) -> float:
    """How many segments the longest of the arcs holds, where there are any."""
    counts = np.bincount((angle_deg // ARCS_DEG[-1]).astype(np.int64))
    return float(counts[counts > 0].mean())


def coherent_px(residual: Array, angle_deg: Array, unknowns: int = 3) -> float:
    """By how much arcs of RELIEF_ARC_DEG lie off as a whole, px RMS, in a residual (n,) left by a fit of so many
    unknowns: the arcs' means beyond what segments that err on their own leave in them, and beyond EDGE_PX. 0 where
    there are too few arcs to tell."""
    means = arc_means(residual, angle_deg, unknowns)
    return 0.0 if means is None else float(np.sqrt(max(means[0] - means[1] - EDGE_PX**2, 0.0)))


def most_coherent_px(residual: Array, angle_deg: Array, unknowns: int = 3) -> float:
    """By how much they do at most, px RMS: errors of the edges that are the same along an arc only add to what is seen.
    EDGE_PX, which may hide as much, where there are too few arcs to tell."""
    means = arc_means(residual, angle_deg, unknowns)
    if means is None:
        return EDGE_PX
    return float(np.sqrt(min(means[0], max(means[0] - means[1], EDGE_PX**2))))


def arc_means(residual: Array, angle_deg: Array, unknowns: int) -> tuple[float, float] | None:
    """Mean square of the arcs' means, px2, and the part of it that segments leave which err on their own; None where
    there are too few arcs to tell."""
    arc = (angle_deg // RELIEF_ARC_DEG).astype(np.int64)
    count, total = np.bincount(arc), np.bincount(arc, residual)
    full = count >= FEWEST_IN_ARC
    arcs, kept = int(full.sum()), full[arc]
    if arcs <= unknowns:
        return None
    mean = np.divide(total, count, out=np.zeros(len(count)), where=full)
    own = float(np.sum((residual - mean[arc])[kept] ** 2)) / max(int(kept.sum()) - arcs, 1)
    of_arcs = float(count[full] @ mean[full] ** 2) / kept.sum() * arcs / (arcs - unknowns)
    by_chance = CORRELATED_SEGMENTS * own * arcs / kept.sum()
    return of_arcs, by_chance


def relief_covariance(design: Array, angle_deg: Array, relief_px: float) -> Array:
    """Covariance (m, m) of a fit of design (n, m) to a limb whose relief is relief_px, 1-sigma, the same within arcs of
    RELIEF_ARC_DEG and independent between them."""
    inverse = np.linalg.pinv(design.T @ design, hermitian=True)
    arc = (angle_deg // RELIEF_ARC_DEG).astype(np.int64)
    sums = np.stack([np.bincount(arc, column) for column in design.T], axis=1)
    return np.asarray(relief_px**2 * inverse @ (sums.T @ sums) @ inverse)
