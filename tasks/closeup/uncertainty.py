"""Errors of a close-up's pose, in the parameters that products state."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from tasks.closeup.level import Level
from tasks.closeup.motion import DIFFERENCE, Anchor, moved, responses
from tasks.joint.parameters import State, difference
from tasks.project.points import body_points, pixels_of_points
from tasks.simulate import Scene

Array = NDArray[np.float64]

# As `tasks.joint.parameters` names and measures them.
UNKNOWNS = ("x", "y", "range", "roll", "attitude_x", "attitude_y", "attitude_z")
ATTITUDE_STEP_DEG = 0.01


@dataclass(frozen=True)
class Errors:
    """covariance: (7, 7) of UNKNOWNS. place_px: largest 1-sigma, along any direction, of where the frame has the
    surface, RMS over the frame: without the map's own errors."""

    covariance: Array
    place_px: float


def errors_of(
    pose: Pose, scene: Scene, covariance: Array, map_error_px: float, attitude_deg: float, map_frame_deg: float
) -> Errors:
    """Of a motion whose covariance (4, 4) the patches give, px of the frame and see `closeup.motion`.

    map_error_px: 1-sigma along each axis of the map's own places, px. attitude_deg: of the body's orientation about
    each axis. A turn of the body and a turn of the camera that undoes it in the frame cannot be told apart, so that
    their errors go together: what a pixel sees stays as well known as the map.
    """
    camera, target = scene.camera, scene.target
    xy = Level.on_body(Level(1, scene, None), pose)  # type: ignore[arg-type]
    anchor = Anchor.at(pose, camera, target, xy)
    response = responses(pose, camera, target, anchor, xy)
    of_place = np.einsum("nik,kl,njl->nij", response, covariance, response).mean(axis=0)
    with_map = covariance + np.diag([map_error_px**2, map_error_px**2, 0.0, 0.0])
    stated = np.column_stack([_stated(pose, scene, anchor, step) for step in np.diag(DIFFERENCE)]) / DIFFERENCE
    turned = _by_attitude(pose, scene, xy)
    undone = -np.linalg.lstsq(response.reshape(-1, 4), turned.reshape(-1, 3), rcond=None)[0]
    together = np.vstack([stated @ undone, np.eye(3)])
    full = np.zeros((7, 7))
    full[:4, :4] = stated @ with_map @ stated.T
    full[4:, 4:] = map_frame_deg**2 * np.eye(3)
    full += attitude_deg**2 * together @ together.T
    return Errors((full + full.T) / 2, float(np.sqrt(np.linalg.eigvalsh(of_place)[-1])))


def _stated(pose: Pose, scene: Scene, anchor: Anchor, step: Array) -> Array:
    """What a small step (4,) of the motion is in the first four of UNKNOWNS."""
    ahead, back = (State(moved(pose, scene.camera, anchor, sign * step), 1.0) for sign in (1, -1))
    return np.asarray(difference(ahead, back, scene.camera)[:4] / 2)


def _by_attitude(pose: Pose, scene: Scene, xy_px: Array) -> Array:
    """By how much what the pixels (n, 2) show moves per degree of a turn of the body about each axis (n, 2, 3)."""
    points = body_points(pose, scene.camera, scene.target, xy_px)
    columns = []
    for axis in np.eye(3):
        there, back = (
            pixels_of_points(
                pose.replaced(
                    body_from_j2000=rotation_from_vector_deg(sign * ATTITUDE_STEP_DEG * axis).T @ pose.body_from_j2000
                ),
                scene.camera,
                points,
            )
            for sign in (1, -1)
        )
        columns.append((there - back) / (2 * ATTITUDE_STEP_DEG))
    return np.stack(columns, axis=-1)
