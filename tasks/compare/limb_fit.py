"""Least squares on limb shifts: how far the disk must move, and grow, to put the simulated limb on the image's."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.reasons import Reason
from catalog.robust import huber_weight, sigma_about_zero
from tasks.compare.limb_edges import LimbEdges
from tasks.compare.limb_errors import CORRELATED_SEGMENTS, directions_deg, limb_covariance

Array = NDArray[np.float64]
HUBER = 2.0
ROUNDS = 20


@dataclass(frozen=True)
class LimbFit:
    """offset_px (2,) of the disk; growth: relative change of its radius (0 when held). covariance: (3, 3) of both, rows
    of a held growth zero, for segments that err together along arcs (`limb_covariance`); noise_covariance: the same
    for segments that err on their own, what another rendering may change. residual_px: robust sigma left. design
    (n, m): the segments' shift per unit of what was solved, angle_deg (n,): their position angles."""

    offset_px: Array
    growth: float
    covariance: Array
    noise_covariance: Array
    residual_px: float
    design: Array
    angle_deg: Array


def fit_limb(edges: LimbEdges, centre_px: Array, solve_growth: bool, min_points: int) -> LimbFit:
    """Robust (Huber) fit of the shifts across the limb, n . offset + rho growth, with n the outward normal and rho the
    limb's distance from the centre along n. centre_px: (2,) in the frame.

    Raises FailedError when fewer than `min_points` segments were measured.
    """
    if len(edges.shift_px) < min_points:
        raise FailedError(
            Reason.LIMB_NOT_MEASURED,
            f"only {len(edges.shift_px)} segments of the lit limb could be measured{disk_size(edges, centre_px)}, "
            f"needed {min_points}.",
            "Too little of the lit limb is in the frame, range and pointing are far off, or the disk is less than "
            "8 px across.",
        )
    normal = edges.segments.normal
    rho = np.einsum("ij,ij->i", edges.segments.xy_px - centre_px, normal)
    design = np.column_stack([normal, rho]) if solve_growth else normal
    values = edges.across_px
    weight = np.ones(len(values))
    for _ in range(ROUNDS):
        weighted = design * weight[:, None]
        solution = np.linalg.lstsq(weighted.T @ design, weighted.T @ values, rcond=None)[0]
        residual = np.abs(values - design @ solution)
        sigma = max(sigma_about_zero(residual), 1e-6)
        weight = huber_weight(residual, HUBER * sigma)
    left = values - design @ solution
    normal_matrix = (design * weight[:, None]).T @ design / CORRELATED_SEGMENTS
    covariance, noise = np.zeros((3, 3)), np.zeros((3, 3))
    size = design.shape[1]
    angle_deg = directions_deg(edges.segments.xy_px - centre_px)
    covariance[:size, :size] = limb_covariance(design, left, weight, angle_deg)
    noise[:size, :size] = np.linalg.pinv(normal_matrix) * sigma**2
    growth = float(solution[2]) if solve_growth else 0.0
    return LimbFit(np.asarray(solution[:2], np.float64), growth, covariance, noise, sigma, design, angle_deg)


def disk_size(edges: LimbEdges, centre_px: Array) -> str:
    """How large the disk is, in words, where some of its limb was measured."""
    if len(edges.shift_px) == 0:
        return ""
    radius = float(np.median(np.linalg.norm(edges.segments.xy_px - centre_px, axis=1)))
    return f" on a disk of {2 * radius:.0f} px"
