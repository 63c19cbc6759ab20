"""Least squares for the camera's motion from the patches' displacements, each with its own covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.robust import huber_weight
from tasks.closeup.limb import LimbArc
from tasks.closeup.patches import Surfaces

Array = NDArray[np.float64]

# A peak this low, or at the edge of its search, tells nothing.
LEAST_PEAK = 0.3
# Robust weights: a patch off by more of its own sigmas than this counts less and less.
HUBER = 2.0
ROUNDS = 30
LEAST_CURVATURE = 1e-3
HELD = 1e-9
SUREST = 0.99


@dataclass(frozen=True)
class Peaks:
    """Where patches find the map's picture of what they show. index: (n,) of the patches. moved_px: (n, 2) by how far
    what they show must move in the simulation, px. covariance: (n, 2, 2) px^2, right up to one factor for all."""

    index: NDArray[np.int64]
    moved_px: Array
    covariance: Array


def peaks_of(surfaces: Surfaces) -> Peaks:
    """The highest correlation of each patch, by a paraboloid through its neighbours. The covariance is what a
    correlation of this height and curvature leaves open: (1 - c^2) / c times the inverse of its curvature."""
    index, moved, covariances = [], [], []
    for i, surface in enumerate(surfaces.correlation):
        y, x = np.unravel_index(np.argmax(surface), surface.shape)
        height = float(surface[y, x])
        if height < LEAST_PEAK or min(y, x) < 1 or max(y, x) > len(surface) - 2:
            continue
        near = surface[y - 1 : y + 2, x - 1 : x + 2].astype(np.float64)
        slope = np.array([near[1, 2] - near[1, 0], near[2, 1] - near[0, 1]]) / 2
        across = (near[2, 2] - near[2, 0] - near[0, 2] + near[0, 0]) / 4
        xx, yy = near[1, 2] - 2 * height + near[1, 0], near[2, 1] - 2 * height + near[0, 1]
        values, vectors = np.linalg.eigh(-np.array([[xx, across], [across, yy]]))
        values = np.maximum(values, LEAST_CURVATURE)
        inverse = vectors / values @ vectors.T
        place = np.array([x, y]) + np.clip(inverse @ slope, -1, 1) - surfaces.reach_px
        index.append(i)
        moved.append(-place)
        surest = min(height, SUREST)  # a perfect match of a small patch is no perfect measurement
        covariances.append((1 - surest**2) / surest * inverse)
    n = len(index)
    return Peaks(
        np.array(index, np.int64), np.array(moved).reshape(n, 2), np.array(covariances, np.float64).reshape(n, 2, 2)
    )


@dataclass(frozen=True)
class Solution:
    """step: (7,), see `closeup.motion`. covariance: (7, 7). left_px: (n, 2) residuals. scale: factor
    of the peaks' covariances that makes the residuals as large as they should be."""

    step: Array
    covariance: Array
    left_px: Array
    scale: float


def solved(
    response: Array,
    moved_px: Array,
    covariance: Array,
    map_error_px: float,
    prior_off: Array,
    prior_sigma: Array,
    limb: LimbArc | None,
) -> Solution:
    """Robust weighted least squares (Huber's weights on each patch's Mahalanobis distance).

    response: (n, 2, 7); moved_px: (n, 2); covariance: (n, 2, 2), up to a factor that the residuals give.
    map_error_px: 1-sigma along each axis of the map's place under a patch, which no factor changes. prior_off:
    (7,) by how far the unknowns are already from their prior's middle; prior_sigma: (7,), inf where free, 0 where held.
    limb: what an arc of it says, None without.
    """
    peaks, misplaced = np.linalg.inv(covariance), map_error_px**2 * np.eye(2)
    prior = np.diag(np.maximum(prior_sigma, HELD) ** -2.0)
    by_limb = np.zeros_like(prior) if limb is None else limb.information
    limb_right = 0.0 if limb is None else limb.right
    step, scale = np.zeros(len(prior)), 1.0
    for _ in range(ROUNDS):
        left = moved_px - response @ step
        # The median of a Rayleigh distribution is 1.177 of its sigma.
        scale = max(float(np.median(np.einsum("ni,nij,nj->n", left, peaks, left))) / 1.1774**2, 1e-6)
        information = np.linalg.inv(scale * covariance + misplaced)
        weight = huber_weight(np.sqrt(np.einsum("ni,nij,nj->n", left, information, left)), HUBER)
        normal = np.einsum("n,nik,nij,njl->kl", weight, response, information, response) + prior + by_limb
        right = np.einsum("n,nik,nij,nj->k", weight, response, information, moved_px) - prior @ prior_off + limb_right
        step = np.linalg.solve(normal, right)
    left = moved_px - response @ step
    return Solution(step, np.linalg.inv(normal), left, scale)
