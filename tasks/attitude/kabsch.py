"""Rotation between two sets of matching points (paper, section 5.2)."""

import numpy as np
from numpy.typing import NDArray

# Points within this angle (RMS, radians) of one line through the centre leave the turn about it undetermined: what
# flow is wrong by, a tenth of a pixel on a disk of 100 px radius, would become degrees.
MIN_SPREAD_RAD = 0.03


def kabsch(p: NDArray, q: NDArray, weight: NDArray | None = None) -> NDArray[np.float64]:
    """Rotation R (3, 3) about the origin that minimises sum w |R p_i - q_i|^2 for points p, q (n, 3), weights (n,).

    C = P^T Q = U S V^T, R = V diag(1, 1, det(V U^T)) U^T (Kabsch 1978; paper, eq. 13), never a reflection.
    Raises ValueError when the points are fewer than three or (within MIN_SPREAD_RAD) on one line through the origin,
    which leaves a turn undetermined, or when some are not finite.
    """
    p, q = np.asarray(p, np.float64), np.asarray(q, np.float64)
    if p.shape != q.shape or p.ndim != 2 or p.shape[1] != 3 or len(p) < 3:
        raise ValueError(f"two equal sets of at least three points are needed, got {p.shape} and {q.shape}")
    w = np.ones(len(p)) if weight is None else np.asarray(weight, np.float64)
    if not (np.isfinite(p).all() and np.isfinite(q).all() and np.isfinite(w).all()):
        raise ValueError("some points or weights are not finite")
    u, singular, vt = np.linalg.svd((p * w[:, None]).T @ q)
    if min(spread_rad(p, w), spread_rad(q, w), np.sqrt(singular[1] / max(singular[0], 1e-300))) < MIN_SPREAD_RAD:
        raise ValueError("the points are nearly collinear with the centre: a turn about their line is undetermined")
    sign = np.sign(np.linalg.det(vt.T @ u.T))
    return vt.T @ np.diag([1.0, 1.0, sign]) @ u.T


def spread_rad(p: NDArray, weight: NDArray) -> float:
    """RMS angle, radians (small ones), of points p (n, 3) from the line through the origin that fits them best."""
    along, across, _ = np.linalg.svd((p * weight[:, None]).T @ p, compute_uv=False)
    return float(np.sqrt(across / along)) if along > 0 else 0.0


def robust_kabsch(
    p: NDArray, q: NDArray, weight: NDArray, tolerance: float = 3.0, rounds: int = 10
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Kabsch with outliers rejected: pairs whose residual exceeds `tolerance` times the median are left out, until the
    set no longer changes. Returns the rotation and the kept mask (n,). Raises ValueError as `kabsch`."""
    kept = np.ones(len(p), bool)
    rotation = kabsch(p, q, weight)
    for _ in range(rounds):
        distance = np.linalg.norm(p @ rotation.T - q, axis=1)
        now = distance <= max(tolerance * float(np.median(distance[kept])), 1e-12)
        if np.array_equal(now, kept):
            break
        kept = now
        rotation = kabsch(p[kept], q[kept], weight[kept])
    return rotation, kept
