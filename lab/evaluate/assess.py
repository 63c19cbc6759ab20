"""How far a pose is from the truth, and whether its stated uncertainties say so."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import vector_deg_from_rotation
from catalog.target import Target
from lab.simulate.plant import pose_error

Array = NDArray[np.float64]
LEAST_SHARE = 0.2


@dataclass(frozen=True)
class Assessment:
    """A pose minus the truth. centre_px: the target's centre (dx, dy); centre_error_px its length. range_error:
    relative. attitude_deg: rotation vector in body-fixed axes; its angle, and the parts about the line of sight and
    across it. surface_px: RMS distance between where the two poses put visible points of the surface."""

    centre_px: tuple[float, float]
    centre_error_px: float
    range_error: float
    attitude_deg: tuple[float, float, float]
    attitude_error_deg: float
    about_sight_deg: float
    across_sight_deg: float
    surface_px: float

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}


def assess(pose: Pose, truth: Pose, camera: Camera, target: Target) -> Assessment:
    """Compare `pose` with `truth`. The attitude is that of the body in the camera's frame: a camera rolled and a body
    turned about the line of sight are the same error."""
    error = pose_error(pose, truth, camera, target)
    in_camera = vector_deg_from_rotation(pose.camera_from_body @ truth.camera_from_body.T)
    in_body = vector_deg_from_rotation(pose.camera_from_body.T @ truth.camera_from_body)
    sight = truth.target_in_camera_km / truth.range_km
    about = float(in_camera @ sight)
    return Assessment(
        centre_px=error.centre_px,
        centre_error_px=float(np.hypot(*error.centre_px)),
        range_error=error.range,
        attitude_deg=(float(in_body[0]), float(in_body[1]), float(in_body[2])),
        attitude_error_deg=error.attitude_deg,
        about_sight_deg=about,
        across_sight_deg=float(np.linalg.norm(in_camera - about * sight)),
        surface_px=error.surface_px,
    )


def in_sigmas(
    found: Assessment, uncertainty: Mapping[str, Any], not_simulated: Mapping[str, Any] | None = None
) -> dict[str, list[float] | None]:
    """Errors of centre, range and attitude in units of the stated 1-sigma (keys of a result's `uncertainty`), component
    by component; None where no uncertainty is stated. not_simulated: 1-sigma, by the same keys, of what the stated ones
    allow for and simulated images do not have; it is taken out of them."""
    errors = {"centre_px": found.centre_px, "range_factor": (found.range_error,), "attitude_deg": found.attitude_deg}
    lacking = not_simulated or {}
    return {name: _ratios(error, uncertainty.get(name), lacking.get(name, 0.0)) for name, error in errors.items()}


def _ratios(errors: tuple[float, ...], sigmas: Any, lacking: Any) -> list[float] | None:
    if sigmas is None:
        return None
    each = np.atleast_1d(np.asarray(sigmas, dtype=np.float64))
    if each.shape != (len(errors),) or not (np.isfinite(each) & (each > 0)).all():
        return None
    # What is left of a sigma is never nothing: a stated error may be known better than what it allows for.
    each = np.sqrt(np.maximum(each**2 - np.square(lacking), (LEAST_SHARE * each) ** 2))
    return [float(error / sigma) for error, sigma in zip(errors, each, strict=True)]
