"""An arc of the limb in a close-up: each of its edges says how far the limb must move across itself."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.pose import Pose
from catalog.robust import sigma_about_median
from tasks.closeup.level import Level
from tasks.closeup.motion import SIZE, Anchor, small_moves
from tasks.compare.limb_edges import FEWEST_POINTS, LimbSettings, measure_limb
from tasks.compare.limb_errors import EDGE_PX, directions_deg, segments_per_arc, shared_along
from tasks.compare.match import framed_window, match_scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]

EDGES = LimbSettings()
# Edges farther from the others than so many of their robust sigmas are another's.
OUTLIER_SIGMAS = 3.0
# What distortion and photometry do, beside relief, to an arc as a whole, px of the frame, 1-sigma (unmodelled
# distortion of cameras alone is 0.1 to 0.3 px): a short arc must not be taken for better evidence than it is.
SHAPE_PX = 0.2
MARGIN_PX = EDGES.half_px + 8.0


@dataclass(frozen=True)
class LimbArc:
    """design: (n, 7) shift of each edge, px of the level, per unit of a motion (see `closeup.motion`). shift_px: (n,)
    image minus simulation, outward. weighted: (n, 7) the design times the inverse covariance of the edges."""

    design: Array
    shift_px: Array
    weighted: Array

    @property
    def information(self) -> Array:
        """(7, 7)."""
        return np.asarray(self.weighted.T @ self.design)

    @property
    def right(self) -> Array:
        """(7,) right side of the normal equations."""
        return np.asarray(self.weighted.T @ self.shift_px)


def limb_arc(level: Level, pose: Pose, anchor: Anchor) -> LimbArc | None:
    """What of the limb is in the frame, as far as it is lit and usable; None where that is too little to be measured.

    A motion moves an edge by n . dc + r d(ln R): the displacement of the disk's centre along the normal n, and the
    growth of the disk, R its radius and r the edge's distance from the centre along n.
    """
    scene = level.scene
    try:
        match = match_scene(level.observation, scene, pose, framed_window(scene, pose, MARGIN_PX))
        edges = measure_limb(match, EDGES)
    except FailedError:
        return None
    if len(edges.shift_px) < FEWEST_POINTS:
        return None
    shift = edges.across_px
    sigma = max(sigma_about_median(shift), EDGE_PX)
    kept = np.abs(shift - np.median(shift)) <= OUTLIER_SIGMAS * sigma
    if np.count_nonzero(kept) < FEWEST_POINTS:
        return None
    shift, normal = shift[kept], edges.segments.normal[kept]
    away = edges.segments.xy_px[kept] - scene.camera.project(pose.target_in_camera_km)
    reach = np.einsum("ij,ij->i", away, normal)
    design = np.empty((len(shift), SIZE))
    for unknown, (ahead, back, apart) in enumerate(small_moves(pose, scene.camera, anchor)):
        centre = scene.camera.project(ahead.target_in_camera_km) - scene.camera.project(back.target_in_camera_km)
        radii = [disk_radius_px(each, scene.camera, scene.target) for each in (ahead, back)]
        design[:, unknown] = (normal @ centre + reach * np.log(radii[0] / radii[1])) / apart
    left, angle = shift - shift.mean(), directions_deg(away)
    together = float(np.mean(left**2)) * shared_along(left, angle)
    variance = max(together, EDGE_PX**2 * segments_per_arc(angle))
    return LimbArc(design, shift, weighted(design, variance, away, shape_px(level, pose)))


def shape_px(level: Level, pose: Pose) -> float:
    """By how much an arc as a whole may be shifted, tilted or bent, px of the level, 1-sigma."""
    target, scene = level.scene.target, level.scene
    relief = target.expected_relief_km / target.mean_radius_km * disk_radius_px(pose, scene.camera, target)
    return float(np.hypot(SHAPE_PX / level.n, relief))


def weighted(design: Array, variance: float, away_px: Array, shape_px: float) -> Array:
    """The design (m, 7) times the inverse covariance of its edges: `variance` px^2 of each, so that those which err
    together count as one, and a common offset, slope and curvature along the arc, of shape_px each."""
    mean = away_px.mean(axis=0)
    along = away_px @ np.array([-mean[1], mean[0]]) / np.linalg.norm(mean)
    along = (along - along.mean()) / max(float(np.ptp(along)) / 2, 1e-9)
    shape = shape_px * np.stack([np.ones_like(along), along, 1.5 * along**2 - 0.5], axis=1)
    inner = np.linalg.inv(np.eye(shape.shape[1]) + shape.T @ shape / variance)
    return np.asarray((design - shape @ (inner @ (shape.T @ design)) / variance) / variance)
