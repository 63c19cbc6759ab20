"""What an orientation that is not known does to centre and range, by the outline of a body that is no sphere."""

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from tasks.joint.parameters import NAMES, OFFSET, RANGE
from tasks.project.curves import limb
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
SAMPLES, LIMB_POINTS, DIRECTIONS = 40, 180, 90


def outline_spread(pose: Pose, scene: Scene, sigma_deg: float, fewest_directions: int) -> Array:
    """Covariance (8, 8) of the unknowns when the body may be turned from `pose` by `sigma_deg`, 1-sigma about each
    axis: the change of centre and range that keeps the lit limb in place, averaged over such turns; none where fewer
    than `fewest_directions` of 90 are lit."""
    spread = np.zeros((len(NAMES), len(NAMES)))
    radius = disk_radius_px(pose, scene.camera, scene.target)
    angle = np.linspace(-np.pi, np.pi, DIRECTIONS, endpoint=False)
    here, lit = outline(pose, scene, angle)
    if lit.sum() < fewest_directions:
        return spread
    design = np.column_stack([np.cos(angle), np.sin(angle), np.full_like(angle, -radius)])[lit]
    turns = np.random.default_rng(1).standard_normal((SAMPLES, 3)) * sigma_deg
    for turn in turns:
        turned = pose.replaced(body_from_j2000=rotation_from_vector_deg(turn).T @ pose.body_from_j2000)
        there, _ = outline(turned, scene, angle)
        step = np.zeros(len(NAMES))
        step[[OFFSET.start, OFFSET.start + 1, RANGE]] = np.linalg.lstsq(design, (here - there)[lit], rcond=None)[0]
        spread += np.outer(step, step) / SAMPLES
    return spread


def outline(pose: Pose, scene: Scene, angle: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Distance (n,), px, of the limb from the target's centre in the directions `angle` (n,) of the picture, radians,
    and whether it is lit there."""
    curve = limb(pose, scene.camera, scene.target, LIMB_POINTS)
    away = curve.xy_px - scene.camera.project(pose.target_in_camera_km)
    direction = np.arctan2(away[:, 1], away[:, 0])
    order = np.argsort(direction)
    lit = np.interp(angle, direction[order], curve.illuminated[order].astype(np.float64), period=2 * np.pi) > 0.5
    distance = np.interp(angle, direction[order], np.linalg.norm(away, axis=1)[order], period=2 * np.pi)
    return distance, lit
