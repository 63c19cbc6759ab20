"""How far the uncertainty of the pose, and of a pixel's own place, moves its latitude and longitude."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target

Array = NDArray[np.float64]

# As the joint estimator moves a pose (`tasks.joint.parameters`): the camera is turned until the target's centre is
# elsewhere, the distance scaled, the camera rolled about the line to the target, the body turned about its own axes.
PARAMETERS = (
    "offset_x_px", "offset_y_px", "range_factor", "roll_deg", "attitude_x_deg", "attitude_y_deg", "attitude_z_deg",
)  # fmt: skip
PLACES = {"offset_px": slice(0, 2), "range_factor": slice(2, 3), "roll_deg": slice(3, 4), "attitude_deg": slice(4, 7)}
ATTITUDE = PLACES["attitude_deg"]
# A roll that nobody states is a part of the attitude: the image cannot tell one from the other.
NEEDED = ("offset_px", "range_factor", "attitude_deg")
BLOCK = 4096
# Beyond these an angle is simply unknown: a longitude that may be any scatters by 180 / sqrt(3) degrees (RMS).
MAX_LATITUDE_SIGMA_DEG, MAX_LONGITUDE_SIGMA_DEG = 90.0, 180.0 / 3**0.5


@dataclass(frozen=True)
class PoseUncertainty:
    """Covariance (7, 7) of PARAMETERS. not_included: names of the parameters whose uncertainty nobody knows.
    map_frame_deg: 1-sigma about each axis of the body that the covariance holds for how the base map lies in the
    body's frame."""

    covariance: Array
    not_included: tuple[str, ...] = ()
    map_frame_deg: float = 0.0

    def __post_init__(self) -> None:
        size = len(PARAMETERS)
        if self.covariance.shape != (size, size) or not np.isfinite(self.covariance).all():
            raise ValueError(f"the covariance must be finite and (7, 7), got shape {self.covariance.shape}")

    @classmethod
    def from_sigmas(cls, sigmas: Mapping[str, Any]) -> "PoseUncertainty":
        """From 1-sigma values `offset_px` [2], `range_factor`, `roll_deg`, `attitude_deg` [3], without correlations. A
        value that is missing or None counts as zero and, but for the roll's, is listed in `not_included`. Raises
        ValueError for a wrong length."""
        diagonal = np.zeros(len(PARAMETERS))
        for name, place in PLACES.items():
            if sigmas.get(name) is not None:
                diagonal[place] = checked_sigmas(name, sigmas[name]) ** 2
        return cls(np.diag(diagonal), tuple(name for name in NEEDED if sigmas.get(name) is None))

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON, as a cube's attribute `uncertainty` has it."""
        return {
            "parameters": list(PARAMETERS),
            "covariance": self.covariance.tolist(),
            "not_included": list(self.not_included),
            "map_frame_deg": self.map_frame_deg,
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "PoseUncertainty":
        """What `to_dict` gives; or of a cube that names no parameters: without the roll, which older ones left out."""
        names = content.get("parameters") or [name for name in PARAMETERS if name != "roll_deg"]
        rows = [PARAMETERS.index(name) for name in names]
        covariance = np.zeros((len(PARAMETERS),) * 2)
        covariance[np.ix_(rows, rows)] = content["covariance"]
        return cls(covariance, tuple(content.get("not_included", ())), float(content.get("map_frame_deg", 0.0)))

    @property
    def of_map_frame(self) -> "PoseUncertainty":
        """The part of the map's frame alone."""
        covariance = np.zeros_like(self.covariance)
        covariance[ATTITUDE, ATTITUDE] = self.map_frame_deg**2 * np.eye(3)
        return replace(self, covariance=covariance)

    @property
    def without_map_frame(self) -> "PoseUncertainty":
        """Everything but the map's frame."""
        return replace(self, covariance=self.covariance - self.of_map_frame.covariance, map_frame_deg=0.0)


def checked_sigmas(name: str, value: ArrayLike) -> Array:
    """Sigmas (n,) of one of PLACES. Raises ValueError for a wrong length, or what is not finite."""
    sigma, size = np.atleast_1d(np.asarray(value, dtype=np.float64)), PLACES[name].stop - PLACES[name].start
    if sigma.shape != (size,) or not np.isfinite(sigma).all():
        raise ValueError(f"the uncertainty of {name} must be {size} finite numbers, got {value!r}")
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

    Linear: sqrt(J C J^T) with `coordinate_jacobian`, and the place's part added in squares; so it grows without limit
    towards the limb (and longitude's towards the poles), where it is cut at 90 degrees, and at the 103.9 of a longitude
    that may be any.
    """
    half, points = _square_root(uncertainty.covariance), np.asarray(points_km, dtype=np.float64)
    place = np.broadcast_to(np.asarray(place_px, dtype=np.float64), points.shape[1:])
    sigmas = np.empty((2, points.shape[1]))
    for start in range(0, points.shape[1], BLOCK):  # blocks fit the processor's cache: four times faster than at once
        block = slice(start, start + BLOCK)
        view = _View(pose, camera, target, points[:, block])
        for sigma, along in zip(sigmas, view.alongs(), strict=True):
            of_place = place[block] ** 2 * np.sum(view.by_place(along) ** 2, axis=0)
            sigma[block] = np.sqrt(np.sum((half.T @ view.by_parameters(along)) ** 2, axis=0) + of_place)
    return np.minimum(sigmas[0], MAX_LATITUDE_SIGMA_DEG), np.minimum(sigmas[1], MAX_LONGITUDE_SIGMA_DEG)


def coordinate_jacobian(pose: Pose, camera: Camera, target: Target, points_km: ArrayLike) -> tuple[Array, Array]:
    """Derivatives (7, n) of latitude and longitude, degrees, by PARAMETERS, in the pixels that see the surface points
    (3, n) km, body-fixed.

    The point P = S + t d stays on its line of sight and on the ellipsoid: with u what S + t d would do if t were
    fixed, dP = u - d (n . u) / (n . d), n the normal. A turn of the camera moves d, a range factor S, a turn of the
    body both.
    """
    view = _View(pose, camera, target, np.asarray(points_km, dtype=np.float64))
    latitude, longitude = (view.by_parameters(along) for along in view.alongs())
    return latitude, longitude


class _View:
    """Surface points (3, n) as the camera sees them, and what moves them."""

    def __init__(self, pose: Pose, camera: Camera, target: Target, points: Array) -> None:
        self.points, self.spacecraft = points, pose.spacecraft_in_body_km
        self.sight = points - self.spacecraft[:, None]
        body_from_camera = pose.camera_from_body.T
        normal = points / np.asarray(target.radii_km)[:, None] ** 2
        self.normal = normal / _dot(normal, self.sight)
        # Body-fixed rotation vectors (3, 3) of the camera, radians per unit: of the offset in x and y, of the roll.
        to_target = -self.spacecraft / np.linalg.norm(self.spacecraft)
        offsets = body_from_camera @ _turns_per_px(pose, camera)
        self.turns = np.column_stack([offsets, np.radians(to_target)])
        self.across = body_from_camera[:, :2]
        self.per_px = (body_from_camera[:, 2] @ self.sight) / camera.focal_length_px

    def alongs(self) -> list[Array]:
        """For latitude and longitude, radians: what u (3, n), see `coordinate_jacobian`, is multiplied with."""
        return [g - self.normal * _dot(g, self.sight) for g in _coordinate_gradients(self.points)]

    def by_parameters(self, along: Array) -> Array:
        """Derivatives (7, n), degrees."""
        camera = self.turns.T @ -np.cross(self.sight, along, axis=0)
        body = np.radians(np.cross(along, self.points, axis=0))
        return np.degrees(np.vstack([camera[:2], self.spacecraft @ along, camera[2], body]))

    def by_place(self, along: Array) -> Array:
        """Derivatives (2, n), degrees per pixel, by the place of the pixel itself."""
        return np.degrees(self.across.T @ along * self.per_px)


def _turns_per_px(pose: Pose, camera: Camera) -> Array:
    """Rotation vectors (3, 2) of the camera, in its own frame and without a part about the boresight, that move the
    target's centre by a pixel in x and in y (the derivative of `tasks.point.rotation.pose_moved_by`)."""
    x, y, z = pose.target_in_camera_km
    x, y = x / z, y / z
    moved = camera.focal_length_px * np.array([[-x * y, 1 + x * x], [-(1 + y * y), x * y]])
    return np.vstack([np.linalg.inv(moved), np.zeros(2)])


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
    """A matrix H with H H^T = covariance, also for a singular one, and where units differ by many orders."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
    scaled = covariance * np.outer(inverse, inverse)
    values, vectors = np.linalg.eigh((scaled + scaled.T) / 2)
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def stated_uncertainty(corrections: Mapping[str, Mapping[str, Any]]) -> PoseUncertainty:
    """Uncertainty of the pose that `corrections` (results of the steps, in the order of doing) lead to. Each step's
    statement takes the place of earlier ones about the same parameters: with the correlations that it states
    (`unknowns` and `covariance` in its evidence), or without."""
    covariance, known, map_frame_deg = np.zeros((len(PARAMETERS),) * 2), set[str](), 0.0
    for result in corrections.values():
        sigmas = {name: result["uncertainty"].get(name) for name in PLACES}
        stated = [name for name in PLACES if sigmas[name] is not None]
        if not stated:
            continue
        index = np.concatenate([np.arange(len(PARAMETERS))[PLACES[name]] for name in stated])
        covariance[index, :] = covariance[:, index] = 0
        covariance[np.ix_(index, index)] = _block(result["evidence"], stated, sigmas)
        if "attitude_deg" in stated:
            map_frame_deg = float(result["evidence"].get("map_frame_deg") or 0.0)
        known |= set(stated)
    return PoseUncertainty(covariance, tuple(name for name in NEEDED if name not in known), map_frame_deg)


def _block(evidence: Mapping[str, Any], stated: Sequence[str], sigmas: Mapping[str, Any]) -> Array:
    """Covariance (n, n) of what a step states."""
    names = [_SHORT[i] for name in stated for i in range(PLACES[name].start, PLACES[name].stop)]
    unknowns = list(evidence.get("unknowns", ()))
    if "covariance" in evidence and set(names) <= set(unknowns):
        rows = [unknowns.index(name) for name in names]
        return np.asarray(evidence["covariance"], dtype=np.float64)[np.ix_(rows, rows)]
    return np.diag(np.concatenate([checked_sigmas(name, sigmas[name]) for name in stated]) ** 2)


# What steps call the parameters in their evidence.
_SHORT = ("x", "y", "range", "roll", "attitude_x", "attitude_y", "attitude_z")
