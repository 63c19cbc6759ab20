"""Rotation between two sets of matching points (paper, section 5.2)."""

import numpy as np
from numpy.typing import NDArray


def kabsch(p: NDArray, q: NDArray, weight: NDArray | None = None) -> NDArray[np.float64]:
    """Rotation R (3, 3) about the origin that minimises sum w |R p_i - q_i|^2 for points p, q (n, 3), weights (n,).

    C = P^T Q = U S V^T, R = V diag(1, 1, det(V U^T)) U^T (Kabsch 1978; paper, eq. 15), never a reflection.
    Raises ValueError when the points are fewer than three or nearly collinear, which leaves a turn undetermined.
    """
    p, q = np.asarray(p, np.float64), np.asarray(q, np.float64)
    if p.shape != q.shape or p.ndim != 2 or p.shape[1] != 3 or len(p) < 3:
        raise ValueError(f"two equal sets of at least three points are needed, got {p.shape} and {q.shape}")
    w = np.ones(len(p)) if weight is None else np.asarray(weight, np.float64)
    u, singular, vt = np.linalg.svd((p * w[:, None]).T @ q)
    if singular[1] <= 1e-9 * singular[0]:
        raise ValueError("the points are nearly collinear with the centre: a turn about their line is undetermined")
    sign = np.sign(np.linalg.det(vt.T @ u.T))
    return vt.T @ np.diag([1.0, 1.0, sign]) @ u.T


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
