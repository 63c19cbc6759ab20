"""What the disk itself tells of the beam's bending, of which few marks near it may tell little.

The bending moves the disk as a whole, stretches it and bends its limb; a disk whose bending is not quite right is
explained a little better with one more unknown, its strength, for which the marks' own error is the prior.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.joint.gauss_newton import Solution
from tasks.joint.normal_equations import solve_linear
from tasks.joint.parameters import NAMES, OFFSET
from tasks.joint.pyramid import Level
from tasks.joint.uncertainty import covariance_of_all

Array = NDArray[np.float64]
Planes = NDArray[Any]

MOVING = len(NAMES)
# Strength, in the prior's sigmas, that is as good as not held at all.
FREE = 1e3


@dataclass(frozen=True)
class Bending:
    """response: (8,) what the solution moves by when the image is displaced by 1-sigma of the marks' bending. strength:
    by how many of these the image is displaced, sigma: 1-sigma of that; moved_px: RMS displacement of the disk's pixels
    by `strength`. Where the disk tells too little to be worth it or contradicts the marks, strength is 0, sigma 1."""

    response: Array
    strength: float = 0.0
    sigma: float = 1.0
    moved_px: float = 0.0


def bending_shown(solution: Solution, level: Level, planes: Planes, least_px: float | None) -> Bending:
    """Strength of the bending from the solution's last linear problem, with the marks' as a prior of 1-sigma.

    level: the solution's. planes: (2, ny, nx) as in `DistortionError`. least_px: smaller displacements (RMS over the
    disk) are left alone; None: all. All pixels are the image's.
    """
    limits = solution.given.thresholds.contradiction
    along = _over_window(solution, level.planes_down(planes))
    column = _column(solution, along)
    response = level.step_up(response_to(solution, column))
    per_sigma_px = level.n * _rms_on_disk(solution, along)
    # A held centre that is a little off would be taken for bending, too.
    if least_px is None or per_sigma_px <= 0 or solution.held[OFFSET].any():
        return Bending(response)
    problem = solution.problem.extended(column[None], np.array([FREE**-2]))

    fit = solve_linear(problem, solution.fit.weight)
    variance = float(covariance_of_all(problem, fit)[0, 0]) + (limits.bending_feigned_px / per_sigma_px) ** 2
    strength = float(fit.values[0]) / (1 + variance)
    moved_px = abs(strength) * per_sigma_px
    contradicts = abs(float(fit.values[0])) > limits.bending * np.sqrt(1 + variance)
    if contradicts or moved_px < least_px:
        return Bending(response)
    return Bending(response, strength, float(np.sqrt(variance / (1 + variance))), moved_px)


def _over_window(solution: Solution, planes: Planes) -> NDArray[np.float32]:
    window = solution.model.window
    return np.stack([window.crop(plane.astype(np.float32), fill=0) for plane in planes])


def _column(solution: Solution, along: NDArray[np.float32]) -> NDArray[np.float32]:
    """Change of the image (ny, nx) when its pixels are displaced by `along` (2, ny, nx)."""
    per_x, per_y = solution.problem.columns[-MOVING:][OFFSET]
    if solution.held[OFFSET].any():  # these are zero there
        weights = solution.fit.values[: len(solution.model.bases)]
        per_x, per_y = solution.model.derivatives(weights, solution.fit.gain)[OFFSET]
    column = per_x * along[0] + per_y * along[1]
    column[solution.fit.weight <= 0] = 0
    return np.asarray(column, np.float32)


def response_to(solution: Solution, column: NDArray[np.float32]) -> Array:
    """The step (8,) that the solution would take if the image changed by `column` (a considered parameter; Bierman
    1977, Factorization Methods, chapter VIII)."""
    problem = solution.problem
    pulled = replace(problem, image=column, expected=np.zeros_like(problem.expected), huber=np.inf)
    return solve_linear(pulled, solution.fit.weight).values[-MOVING:]


def _rms_on_disk(solution: Solution, along: NDArray[np.float32]) -> float:
    """Of one coordinate of the displacement, over the lit part of the disk."""
    lit = (solution.model.mu0 > 0) & (solution.fit.weight > 0)
    return float(np.sqrt((along[:, lit] ** 2).mean())) if lit.any() else 0.0


def displacement_of(strength: float, planes: Planes) -> NDArray[np.float32]:
    """Where the content of each pixel lies in the image (2, ny, nx), relative to the pixel, by `Bending.strength`."""
    return np.float32(strength) * planes.astype(np.float32)
