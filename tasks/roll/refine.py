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
    """offset_px (2,): how the disk must move. turn_deg, sigma_deg: how camera or target must turn, and its 1-sigma."""

    offset_px: NDArray[np.float64]
    turn_deg: float
    sigma_deg: float


def turn_step(match: Match, kind: str, radius_px: float) -> TurnStep:
    """One linearised step for a turn of `kind` (camera or target); a growth of the disk is solved along, so that a
    wrong distance does not leak into it. Raises FailedError when nothing of the target is on usable pixels."""
    columns = brightness_columns(match.simulation.bases)
    coefficients, _, _ = robust_least_squares(columns, match.image, match.weight)
    model = np.tensordot(coefficients, columns, 1)
    d_row, d_column = np.gradient(model)
    y, x = np.mgrid[: model.shape[0], : model.shape[1]]
    x, y = x - match.centre_px[0], y - match.centre_px[1]
    if kind == CAMERA:
        change = np.radians(d_column * y - d_row * x)
    else:
        change = change_by_target_turn(match, coefficients, radius_px)
    changes = np.stack([-d_column, -d_row, -(d_column * x + d_row * y), change]).astype(np.float32)
    solution, covariance, _ = robust_least_squares(np.concatenate([columns, changes]), match.image, match.weight)
    sigma = float(np.sqrt(max(covariance[-1, -1], 0.0)))
    return TurnStep(solution[-4:-2], float(solution[-1]), sigma)


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
