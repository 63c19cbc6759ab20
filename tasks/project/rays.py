"""Lines of sight and the target's ellipsoid in coordinates where the ellipsoid is the unit sphere.

Body-fixed kilometres divided by the three radii turn the paper's equation 14, (X - V)^T A (X - V) = 1 with
A = R diag(1/r^2) R^T (the paper prints 1/r), into p . p = 1. Normals, silhouettes and shadows become dot products:
a surface point p faces a point s outside (spacecraft or Sun) exactly when p . s > 1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import Target
from tasks.geometry.unit_sphere import first_hits
from tasks.project.sight import sight_of

Array = NDArray[np.float64]
NEARLY_SIDEWAYS = 0.1  # cosine between boresight and target below which the frame's own plane is no use as an anchor


@dataclass(frozen=True)
class Rays:
    """Lines of sight of a frame's pixels, in units of the radii, body-fixed: p(w) = anchor + w * backward.

    anchor, backward: (3, 3), to be multiplied by (1, x - reference_px[0], y - reference_px[1]). `backward` points to
    where the lines start. For a target ahead of the camera the anchor lies in the plane through the target's centre, so
    no large numbers cancel, however far the spacecraft is: the error of p stays near 1e-15 at a range of 1e4 radii.
    spacecraft: (3,), in units of the radii, where the lines start. apparent: (3, 3), to be multiplied likewise: the
    direction in which the camera sees the pixel, body-fixed, not scaled by the radii, of any length.
    """

    anchor: Array
    backward: Array
    reference_px: Array
    spacecraft: Array
    apparent: Array

    @property
    def limb_conic(self) -> Array:
        """Symmetric (3, 3) N: a line of sight meets the body exactly when b . N b >= 0, b = (1, dx, dy) as above."""
        moment = np.cross(self.spacecraft, self.backward.T)
        return self.backward.T @ self.backward - moment @ moment.T

    def at(self, xy_px: ArrayLike) -> tuple[Array, Array]:
        """Anchor and backward vectors, each (..., 3), of pixels (..., 2)."""
        basis = self._basis(xy_px)
        return basis @ self.anchor.T, basis @ self.backward.T

    def apparent_at(self, xy_px: ArrayLike) -> Array:
        """Directions (..., 3), body-fixed, of any length, in which the camera sees pixels (..., 2)."""
        return self._basis(xy_px) @ self.apparent.T

    def _basis(self, xy_px: ArrayLike) -> Array:
        offset = np.asarray(xy_px, dtype=np.float64) - self.reference_px
        return np.concatenate([np.ones_like(offset[..., :1]), offset], axis=-1)


def spacecraft_in_radii(pose: Pose, target: Target) -> Array:
    """Spacecraft (3,), body-fixed, in units of the radii. Raises RefusedError when it lies inside the target."""
    spacecraft = sight_of(pose, target).spacecraft_km / np.asarray(target.radii_km)
    if spacecraft @ spacecraft <= 1.0:
        raise RefusedError(
            Reason.SPACECRAFT_INSIDE_TARGET,
            f"the pose puts the spacecraft {pose.range_km:.6g} km from the centre of {target.name}, inside the body.",
            "Check target_from_spacecraft_km (kilometres) and the target's radii.",
        )
    return spacecraft


def sun_in_radii(pose: Pose, target: Target) -> Array:
    """Sun (3,), body-fixed, in units of the radii. Raises RefusedError when it lies inside the target."""
    sun = pose.body_from_j2000 @ pose.sun_from_target_km / np.asarray(target.radii_km)
    if sun @ sun <= 1.0:
        raise RefusedError(
            Reason.SUN_INSIDE_TARGET,
            f"the pose puts the Sun {np.linalg.norm(pose.sun_from_target_km):.6g} km from the centre of {target.name}.",
            "Check sun_from_target_km: kilometres, not a unit vector.",
        )
    return sun


def rays_of(pose: Pose, camera: Camera, target: Target) -> Rays:
    """Lines of sight of `camera` at `pose`. Raises RefusedError when the spacecraft is inside the target."""
    spacecraft, sight = spacecraft_in_radii(pose, target), sight_of(pose, target)
    scaled_from_camera = sight.body_from_camera / np.asarray(target.radii_km)[:, None]
    to_target = sight.target_in_camera_km
    across = scaled_from_camera[:, :2] / camera.focal_length_px
    if to_target[2] > NEARLY_SIDEWAYS * pose.range_km:
        reference_px, ahead = camera.project(to_target), to_target / to_target[2]
        anchor = np.column_stack([np.zeros(3), across * to_target[2]])
        backward = np.column_stack([spacecraft, -across * to_target[2]])
    else:
        reference_px, ahead = np.asarray(camera.centre_px), np.array([0.0, 0.0, 1.0])
        anchor = np.column_stack([spacecraft, np.zeros((3, 2))])
        backward = -np.column_stack([scaled_from_camera[:, 2], across])
    apparent = np.column_stack(
        [sight.apparent_from_camera @ ahead, sight.apparent_from_camera[:, :2] / camera.focal_length_px]
    )
    return Rays(anchor, backward, reference_px, spacecraft, apparent)


def intersect(rays: Rays, xy_px: ArrayLike) -> Array:
    """Nearest intersections (..., 3) with the unit sphere of pixels (..., 2); NaN where the line misses it
    (paper, equations 13-16)."""
    anchor, backward = rays.at(xy_px)
    points = first_hits(anchor.reshape(-1, 3), backward.reshape(-1, 3), rays.spacecraft)
    return points.reshape(anchor.shape)


def dot(a: Array, b: Array) -> Array:
    """Scalar products (..., 1) of vectors (..., 3)."""
    return np.einsum("...i,...i->...", a, b)[..., None]
