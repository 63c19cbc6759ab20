"""Where a body is in the image by its limb alone, its pose as that of a target."""

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.placed_body import PlacedBody
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import Target
from tasks.bodies.masks import alone
from tasks.bodies.placed import Body
from tasks.compare.limb_edges import LimbSettings, measure_limb
from tasks.compare.limb_fit import fit_limb
from tasks.compare.match import framed_window, match_scene
from tasks.point.rotation import pose_moved_by
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]

ROUNDS, STILL_PX = 5, 0.01
EDGES = LimbSettings()
SKY_PX = EDGES.half_px + 8.0


def by_limb(observation: Observation, pose: Pose, scene: Scene) -> tuple[Array, Array]:
    """Centre (2,) and covariance (2, 2) by the limb before the sky, or else before another body. Raises FailedError."""
    try:
        return settled(observation, pose, scene, keep_behind=False)
    except FailedError:
        return settled(observation, pose, scene, keep_behind=True)


def settled(observation: Observation, pose: Pose, scene: Scene, keep_behind: bool) -> tuple[Array, Array]:
    """Centre (2,) and covariance (2, 2) by the limb, moved until it rests. Raises FailedError."""
    left = alone(observation, pose, scene, keep_behind=keep_behind)
    needed = EDGES.points_needed(disk_radius_px(pose, scene.camera, scene.target))
    for _ in range(ROUNDS):
        window = framed_window(scene, pose, margin_px=SKY_PX)
        edges = measure_limb(match_scene(left, scene, pose, window), EDGES)
        fit = fit_limb(edges, scene.camera.project(pose.target_in_camera_km), solve_growth=False, min_points=needed)
        pose = pose_moved_by(pose, scene.camera, fit.offset_px)
        if np.hypot(*fit.offset_px) < STILL_PX:
            return scene.camera.project(pose.target_in_camera_km), fit.covariance[:2, :2]
    raise FailedError(Reason.JOINT_NOT_SETTLED, f"its limb still moves after {ROUNDS} fits.", "")


def as_target_of(pose: Pose, target: Target, body: Body) -> Pose:
    """The body's own pose, with the image's target and the others as its bodies."""
    if body.place is None:
        return pose
    away = body.place.offset_km
    others = [
        other.model_copy(update={"from_target_km": tuple(other.offset_km - away)})
        for other in pose.bodies
        if other is not body.place
    ]
    sees = body.place.seen_from_km.get(target.naif_id)
    seen_from = {} if sees is None else {body.naif_id: tuple(-np.array(sees))}
    own = PlacedBody.of(
        target,
        from_target_km=tuple(-away),
        sun_from_body_km=tuple(pose.sun_from_target_km),
        body_from_j2000=pose.body_from_j2000,
        velocity_km_s=None if pose.target_velocity_km_s is None else tuple(pose.target_velocity_km_s),
        seen_from_km=seen_from,
        sigma_km=body.place.sigma_km,
    )
    return body.pose.replaced(bodies=(own, *others))
