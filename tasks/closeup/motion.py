"""How a pose moves what the frame shows: pointing and roll of the camera about the frame's middle, range, and the
body's orientation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target
from tasks.point.rotation import smallest_turn
from tasks.project.points import body_points, pixels_of_points

Array = NDArray[np.float64]

# Displacement x, y of what the frame shows in its middle, px; roll about the boresight, degrees, from +x towards +y;
# logarithm of the range factor, by which the surface in the middle does not move; turn of the body about its axes,
# degrees.
X, Y, ROLL, RANGE, ATTITUDE = 0, 1, 2, 3, slice(4, 7)
SIZE = 7
DIFFERENCE = np.array([0.5, 0.5, 0.01, 1e-4, 0.01, 0.01, 0.01])


@dataclass(frozen=True)
class Anchor:
    """A surface point, body-fixed km (3,), that stays at its pixel when the range changes."""

    point_km: Array

    @classmethod
    def at(cls, pose: Pose, camera: Camera, target: Target, xy_px: Array) -> "Anchor":
        """The one that `pose` has at the first of the pixels (n, 2), which sees the body."""
        return cls(body_points(pose, camera, target, xy_px[0]))


def moved(pose: Pose, camera: Camera, anchor: Anchor, step: Array) -> Pose:
    """The pose after a step (7,): see X, Y, ROLL, RANGE, ATTITUDE."""
    before = pixels_of_points(pose, camera, anchor.point_km)
    farther = pose.with_range_factor(float(np.exp(step[RANGE])))
    after = pixels_of_points(farther, camera, anchor.point_km)
    middle = np.asarray(camera.centre_px)
    turn = smallest_turn(camera.ray(after), camera.ray(before))
    turn = smallest_turn(camera.ray(middle), camera.ray(middle + step[[X, Y]])) @ turn
    turn = rotation_from_vector_deg([0.0, 0.0, step[ROLL]]) @ turn
    return farther.replaced(
        camera_from_j2000=turn @ pose.camera_from_j2000,
        body_from_j2000=rotation_from_vector_deg(step[ATTITUDE]).T @ pose.body_from_j2000,
    )


def small_moves(pose: Pose, camera: Camera, anchor: Anchor) -> list[tuple[Pose, Pose, float]]:
    """For each unknown the poses a little ahead and back, and by how much they differ in it."""
    return [
        (moved(pose, camera, anchor, step), moved(pose, camera, anchor, -step), 2 * float(size))
        for step, size in zip(np.diag(DIFFERENCE), DIFFERENCE, strict=True)
    ]


def responses(pose: Pose, camera: Camera, target: Target, anchor: Anchor, xy_px: Array) -> Array:
    """By how much what the pixels xy_px (n, 2) show moves, px per unit of a step: (n, 2, 7); NaN off the body."""
    points = body_points(pose, camera, target, xy_px)
    columns = [
        (pixels_of_points(ahead, camera, points) - pixels_of_points(back, camera, points)) / apart
        for ahead, back, apart in small_moves(pose, camera, anchor)
    ]
    return np.stack(columns, axis=-1)
