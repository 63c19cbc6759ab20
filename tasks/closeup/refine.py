"""From the motion that the patches agree on to the one that fits them best, the map projected anew each time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from tasks.closeup.fit import Solution, peaks_of, solved
from tasks.closeup.level import Level
from tasks.closeup.motion import RANGE, ROLL, Anchor, moved, responses
from tasks.project.points import body_points

Array = NDArray[np.float64]

# How far a patch may still lie off, and the largest move that ends the loop: pixels of the level.
NEAR_PX, STILL_PX = 6, 0.05
ROUNDS = 8
FEWEST_PEAKS = 4


@dataclass(frozen=True)
class Refined:
    """pose; off: (4,) how far roll and range are from their prior's middle. xy_px: (m, 2) the patches with a peak, px
    of the level. solution: of the last round. tried: patches. moves_px: largest move of each round, px of the frame.
    settled: whether the last one was small."""

    pose: Pose
    off: Array
    xy_px: Array
    solution: Solution
    tried: int
    moves_px: list[float]
    settled: bool


def refined(level: Level, pose: Pose, off: Array, prior_sigma: Array, across: int) -> Refined | None:
    """Gauss-Newton on the patches' displacements (see `fit.solved`); None where too few patches have a peak nearby."""
    camera, target = level.scene.camera, level.scene.target
    moves: list[float] = []
    found = None
    for _ in range(ROUNDS):
        surfaces = level.surfaces(pose, NEAR_PX, across)
        peaks = peaks_of(surfaces)
        xy = surfaces.centre_px[peaks.index]
        on_body = np.isfinite(body_points(pose, camera, target, xy)[:, 0])
        if np.count_nonzero(on_body) < FEWEST_PEAKS:
            return None
        xy = xy[on_body]
        anchor = Anchor.at(pose, camera, target, level.on_body(pose))
        response = responses(pose, camera, target, anchor, xy)
        solution = solved(response, peaks.moved_px[on_body], peaks.covariance[on_body], off, prior_sigma)
        pose = moved(pose, camera, anchor, solution.step)
        off = off + np.where(np.isin(range(4), (ROLL, RANGE)), solution.step, 0.0)
        size = float(np.hypot(*np.moveaxis(response @ solution.step, -1, 0)).max())
        moves.append(size * level.n)
        found = Refined(pose, off, xy, solution, len(surfaces), moves, size < STILL_PX)
        if found.settled:
            break
    return found
