"""From the motion that the patches agree on to the one that fits them best, the map projected anew each time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from tasks.closeup.fit import Solution, peaks_of, solved
from tasks.closeup.level import Level
from tasks.closeup.level import on_body as seen_places
from tasks.closeup.limb import LimbArc, limb_arc
from tasks.closeup.motion import ATTITUDE, Anchor, moved, responses
from tasks.project.points import body_points

Array = NDArray[np.float64]

# How far a patch may still lie off, and the largest move that ends the loop: pixels of the level.
NEAR_PX, STILL_PX = 6, 0.05
ROUNDS = 8
FEWEST_PEAKS = 4


@dataclass(frozen=True)
class Refined:
    """pose. off: (7,) how far roll, range and attitude are from their prior's middle. xy_px: (m, 2) the patches with a
    peak, px of the level. solution: of the last round. tried: patches. moves_px: largest move of each round, px of the
    frame. settled: whether the last one was small. limb: the arc that was measured in the last round, None without."""

    pose: Pose
    off: Array
    xy_px: Array
    solution: Solution
    tried: int
    moves_px: list[float]
    settled: bool
    limb: LimbArc | None = None


def refined(
    level: Level, pose: Pose, off: Array, prior_sigma: Array, map_error_px: float, across: int
) -> Refined | None:
    """Gauss-Newton on the displacements of patches and of an arc of the limb (see `fit.solved`); None where too few
    patches have a peak nearby. map_error_px: of the map's places, 1-sigma, px of the level. Without a limb the body's
    orientation stays: a turn of the camera does as well."""
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
        anchor = Anchor.at(pose, camera, target, seen_places(pose, level.scene))
        response = responses(pose, camera, target, anchor, xy)
        limb = limb_arc(level, pose, anchor)
        sigma = prior_sigma.copy()
        if limb is None:
            sigma[ATTITUDE] = 0.0
        displacement, errors = peaks.moved_px[on_body], peaks.covariance[on_body]
        solution = solved(response, displacement, errors, map_error_px, off, sigma, limb)
        pose = moved(pose, camera, anchor, solution.step)
        off = off + np.where(np.isfinite(prior_sigma), solution.step, 0.0)
        size = float(np.hypot(*np.moveaxis(response @ solution.step, -1, 0)).max())
        moves.append(size * level.n)
        found = Refined(pose, off, xy, solution, len(surfaces), moves, size < STILL_PX, limb)
        if found.settled:
            break
    return found
