"""Errors of a close-up's pose, in the parameters that products state."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from tasks.closeup.level import on_body
from tasks.closeup.motion import ATTITUDE, SIZE, Anchor, responses, small_moves
from tasks.joint.parameters import State, difference
from tasks.simulate import Scene

Array = NDArray[np.float64]

# As `tasks.joint.parameters` names and measures them.
UNKNOWNS = ("x", "y", "range", "roll", "attitude_x", "attitude_y", "attitude_z")


@dataclass(frozen=True)
class Errors:
    """covariance: (7, 7) of UNKNOWNS. place_px: largest 1-sigma, along any direction, of where the frame has the
    surface, RMS over the frame: without the map's own errors."""

    covariance: Array
    place_px: float


def errors_of(pose: Pose, scene: Scene, covariance: Array, map_error_px: float, attitude_deg: float) -> Errors:
    """Of a motion whose covariance (7, 7) patches and limb give, px of the frame and see `closeup.motion`.

    map_error_px: 1-sigma along each axis of the map's own places, px. attitude_deg: of the body's orientation about
    each axis where no limb tells it from the camera's: 0 where one does. A turn of the body and a turn of the camera
    that undoes it in the frame go together then, so that what a pixel sees stays as well known as the map. The map's
    errors move the camera, or the body where the limb holds the camera.
    """
    camera = scene.camera
    xy = on_body(pose, scene)
    anchor = Anchor.at(pose, camera, scene.target, xy)
    response = responses(pose, camera, scene.target, anchor, xy)
    of_place = np.einsum("nik,kl,njl->nij", response, covariance, response).mean(axis=0)
    camera_part = response[:, :, : ATTITUDE.start].reshape(-1, ATTITUDE.start)
    body_part = response[:, :, ATTITUDE].reshape(-1, 3)
    undone = np.vstack([-np.linalg.lstsq(camera_part, body_part, rcond=None)[0], np.eye(3)])
    full = covariance + attitude_deg**2 * undone @ undone.T
    if attitude_deg > 0:
        full[:2, :2] += map_error_px**2 * np.eye(2)
    else:
        per_px = np.linalg.norm(body_part) / np.sqrt(len(body_part) * 1.5)
        full[ATTITUDE, ATTITUDE] += (map_error_px / max(per_px, 1e-9)) ** 2 * np.eye(3)
    stated = np.empty((SIZE, SIZE))
    for unknown, (ahead, back, apart) in enumerate(small_moves(pose, camera, anchor)):
        stated[:, unknown] = difference(State(ahead, 1.0), State(back, 1.0), camera)[:SIZE] / apart
    full = stated @ full @ stated.T
    full[4:, 4:] += scene.map_frame_deg**2 * np.eye(3)
    return Errors((full + full.T) / 2, float(np.sqrt(np.linalg.eigvalsh(of_place)[-1])))
