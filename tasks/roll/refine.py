"""Roll from near: least squares on the image, the turns solved with offset, growth and brightness."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.compare.brightness import brightness_columns, robust_least_squares
from tasks.compare.match import Match
from tasks.roll.turns import target_turned

CAMERA, TARGET = "camera", "target"
# A step of the finite difference moves the limb's markings by about this.
DIFFERENCE_PX = 0.7


@dataclass(frozen=True)
class TurnStep:
    """offset_px (2,): how the disk must move. turns_deg, sigma_deg: by kind (camera, target), those that were solved.
    correlation: between the two turns' errors, 0 when only one was solved."""

    offset_px: NDArray[np.float64]
    turns_deg: dict[str, float]
    sigma_deg: dict[str, float]
    correlation: float


def turn_step(match: Match, kinds: tuple[str, ...], radius_px: float) -> TurnStep:
    """One linearised step. kinds: the turns to solve; a growth of the disk is solved along, so that a wrong distance
    does not leak into them. Raises FailedError when nothing of the target is on usable pixels."""
    columns = brightness_columns(match.simulation.bases)
    coefficients, _, _ = robust_least_squares(columns, match.image, match.weight)
    model = np.tensordot(coefficients, columns, 1)
    d_row, d_column = np.gradient(model)
    y, x = np.mgrid[: model.shape[0], : model.shape[1]]
    x, y = x - match.centre_px[0], y - match.centre_px[1]
    changes = [-d_column, -d_row, -(d_column * x + d_row * y)]
    if CAMERA in kinds:
        changes.append(np.radians(d_column * y - d_row * x))
    if TARGET in kinds:
        changes.append(change_by_target_turn(match, coefficients, radius_px))
    solution, covariance, _ = robust_least_squares(
        np.concatenate([columns, np.stack(changes).astype(np.float32)]), match.image, match.weight
    )
    first = len(columns) + 3
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0))[first:]
    both = len(kinds) == 2 and sigma.min() > 0
    together = float(covariance[first, first + 1] / (sigma[0] * sigma[1])) if both else 0.0
    order = [kind for kind in (CAMERA, TARGET) if kind in kinds]
    return TurnStep(
        offset_px=solution[len(columns) : len(columns) + 2],
        turns_deg=dict(zip(order, map(float, solution[first:]), strict=True)),
        sigma_deg=dict(zip(order, map(float, sigma), strict=True)),
        correlation=together,
    )


def change_by_target_turn(match: Match, coefficients: NDArray, radius_px: float) -> NDArray[np.float64]:
    """How the simulated image (ny, nx) changes per degree of the target's turn, by two renders on either side: the one
    of the match itself has its sampling errors in the residuals too, which would pass for a turn."""
    step_deg = float(np.degrees(DIFFERENCE_PX / max(radius_px, 1.0)))
    ahead, behind = (
        match.scene.render(target_turned(match.pose, step), match.simulation.window).bases
        for step in (step_deg, -step_deg)
    )
    change: NDArray[np.float64] = np.tensordot(coefficients[: len(ahead)], ahead - behind, 1) / (2 * step_deg)
    return change
