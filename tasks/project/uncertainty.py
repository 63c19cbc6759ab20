"""How far the uncertainty of the pose, and of a pixel's own place, moves its latitude and longitude."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target

Array = NDArray[np.float64]

PARAMETERS = (
    "offset_x_px", "offset_y_px", "range_factor", "attitude_x_deg", "attitude_y_deg", "attitude_z_deg",
)  # fmt: skip
SIZES = {"offset_px": 2, "range_factor": 1, "attitude_deg": 3}
BLOCK = 4096
MAX_LATITUDE_SIGMA_DEG, MAX_LONGITUDE_SIGMA_DEG = 90.0, 180.0  # beyond these, an angle is simply unknown


@dataclass(frozen=True)
class PoseUncertainty:
    """Covariance (6, 6) of PARAMETERS: the target's place in the image, its distance relative to the pose's, and the
    turn of the body about its own axes. not_included: names of the parameters whose uncertainty nobody knows."""

    covariance: Array
    not_included: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.covariance.shape != (6, 6) or not np.isfinite(self.covariance).all():
            raise ValueError(f"the covariance must be finite and (6, 6), got shape {self.covariance.shape}")

    @classmethod
    def from_sigmas(cls, sigmas: Mapping[str, Any]) -> "PoseUncertainty":
        """From 1-sigma values `offset_px` [2], `range_factor`, `attitude_deg` [3], without correlations. A value that
        is missing or None counts as zero and is listed in `not_included`. Raises ValueError for a wrong length."""
        unknown = tuple(name for name in SIZES if sigmas.get(name) is None)
        values = [np.zeros(n) if name in unknown else _checked(name, sigmas[name]) for name, n in SIZES.items()]
        return cls(np.diag(np.concatenate(values) ** 2), unknown)


def _checked(name: str, value: ArrayLike) -> Array:
    sigma = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if sigma.shape != (SIZES[name],) or not np.isfinite(sigma).all():
        raise ValueError(f"the uncertainty of {name} must be {SIZES[name]} finite numbers, got {value!r}")
    return sigma


def coordinate_sigmas(
    pose: Pose,
    camera: Camera,
    target: Target,
    uncertainty: PoseUncertainty,
    points_km: ArrayLike,
    place_px: ArrayLike = 0.0,
) -> tuple[Array, Array]:
    """1-sigma of latitude and longitude (n,), degrees, where the surface points (3, n) km, body-fixed, are seen.

    place_px: (n,) or one number, 1-sigma of each coordinate of a pixel's undistorted place, alike in all directions and
    independent of the pose's errors: what the distortion adds.

    Linear: sqrt(J C J^T) with `coordinate_jacobian`, and the place's part, which moves the line of sight as an offset
    does, added in squares; so it grows without limit towards the limb (and longitude's towards the poles), where it is
    cut at 90 and 180 degrees.
    """
    half, points = _square_root(uncertainty.covariance), np.asarray(points_km, dtype=np.float64)
    place = np.broadcast_to(np.asarray(place_px, dtype=np.float64), points.shape[1:])
    sigmas = np.empty((2, points.shape[1]))
    for start in range(0, points.shape[1], BLOCK):  # blocks fit the processor's cache: four times faster than at once
        block = slice(start, start + BLOCK)
        for sigma, jacobian in zip(sigmas, coordinate_jacobian(pose, camera, target, points[:, block]), strict=True):
            of_place = place[block] ** 2 * np.sum(jacobian[:2] ** 2, axis=0)
            sigma[block] = np.sqrt(np.sum((half.T @ jacobian) ** 2, axis=0) + of_place)
    return np.minimum(sigmas[0], MAX_LATITUDE_SIGMA_DEG), np.minimum(sigmas[1], MAX_LONGITUDE_SIGMA_DEG)


def coordinate_jacobian(pose: Pose, camera: Camera, target: Target, points_km: ArrayLike) -> tuple[Array, Array]:
    """Derivatives (6, n) of latitude and longitude, degrees, by PARAMETERS, in the pixels that see the surface points
    (3, n) km, body-fixed.

    The point P = S + t d stays on its line of sight and on the ellipsoid: with u what S + t d would do if t were
    fixed, dP = u - d (n . u) / (n . d), n the normal. An offset moves d, a range factor S, a turn of the body both.
    """
    points = np.asarray(points_km, dtype=np.float64)
    spacecraft, radii2 = pose.spacecraft_in_body_km, np.asarray(target.radii_km) ** 2
    body_from_camera = pose.camera_from_body.T
    sight, normal = points - spacecraft[:, None], points / radii2[:, None]
    shift = (body_from_camera[:, 2] @ sight) * (-1.0 / camera.focal_length_px)
    normal /= _dot(normal, sight)
    latitude, longitude = (gradient - normal * _dot(gradient, sight) for gradient in _coordinate_gradients(points))

    def by_parameters(along: Array) -> Array:
        offset = body_from_camera[:, :2].T @ along * shift
        turn = np.radians(np.cross(along, points, axis=0))
        return np.degrees(np.vstack([offset, spacecraft @ along, turn]))

    return by_parameters(latitude), by_parameters(longitude)


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("in,in->n", a, b)


def _coordinate_gradients(points: Array) -> tuple[Array, Array]:
    """Gradients (3, n) of planetocentric latitude and of longitude, radians per km."""
    x, y, z = points
    rho = np.maximum(np.hypot(x, y), 1e-9)
    latitude = np.stack([-z * x / rho, -z * y / rho, rho]) / _dot(points, points)
    longitude = np.stack([-y, x, np.zeros_like(x)]) / rho**2
    return latitude, longitude


def _square_root(covariance: Array) -> Array:
    """A matrix H with H H^T = covariance, also for a singular one."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return vectors * np.sqrt(np.maximum(values, 0.0))
