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


def relief_covariance(design: Array, angle_deg: Array, relief_px: float) -> Array:
    """Covariance (m, m) of a fit of design (n, m) to a limb whose relief is relief_px, 1-sigma, the same within arcs of
    RELIEF_ARC_DEG and independent between them."""
    inverse = np.linalg.pinv(design.T @ design, hermitian=True)
    arc = (angle_deg // RELIEF_ARC_DEG).astype(np.int64)
    sums = np.stack([np.bincount(arc, column) for column in design.T], axis=1)
    return np.asarray(relief_px**2 * inverse @ (sums.T @ sums) @ inverse)
