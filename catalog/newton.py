"""Newton's method for maps of the plane: how smooth distortion models are inverted."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]
PointMap = Callable[[Points], Points]

NEWTON_STEPS = 30
STEPS_PER_JACOBIAN = 8
NEWTON_TOLERANCE_PX = 1e-10
ACCEPTED_RESIDUAL_PX = 1e-7
DERIVATIVE_STEP_PX = 1e-3


def solve_points(function: PointMap, wanted: ArrayLike, start: ArrayLike) -> Points:
    """Points p (..., 2) with function(p) = wanted, by Newton's method from `start`, all points at once.

    NaN where it does not reach `ACCEPTED_RESIDUAL_PX` (for example where the map folds over). The derivative is by
    central differences, so the map may be any smooth one; it is renewed every few steps, being the costly part.
    """
    wanted = np.asarray(wanted, dtype=np.float64)
    shape = wanted.shape
    target, points = wanted.reshape(-1, 2), np.array(start, dtype=np.float64).reshape(-1, 2)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        jacobian = np.empty((0, 2, 2))
        for step in range(NEWTON_STEPS):
            residual = function(points) - target
            if not (np.abs(residual) > NEWTON_TOLERANCE_PX).any():
                break
            jacobian = jacobian if step % STEPS_PER_JACOBIAN else _jacobian(function, points)
            points = points - _step(jacobian, residual)
        missed = ~(np.abs(function(points) - target).max(axis=-1, initial=0) <= ACCEPTED_RESIDUAL_PX)
    points[missed] = np.nan
    return points.reshape(shape)


def _jacobian(function: PointMap, points: Points) -> NDArray[np.float64]:
    columns = []
    for axis in ((DERIVATIVE_STEP_PX, 0.0), (0.0, DERIVATIVE_STEP_PX)):
        columns.append((function(points + axis) - function(points - axis)) / (2 * DERIVATIVE_STEP_PX))
    return np.stack(columns, axis=-1)


def _step(jacobian: NDArray[np.float64], residual: Points) -> Points:
    (a, b), (c, d) = np.moveaxis(jacobian, (-2, -1), (0, 1))
    u, v = residual[..., 0], residual[..., 1]
    return np.stack([d * u - b * v, a * v - c * u], axis=-1) / (a * d - b * c)[..., None]
