"""Range from the lit limb: the growth that puts the simulated limb on the image's, solved with the offset."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.compare.limb_edges import LimbSettings, measure_limb
from tasks.compare.limb_errors import relief_covariance
from tasks.compare.limb_fit import LimbFit, fit_limb
from tasks.compare.match import match_scene
from tasks.correction import FORMAL, Correction
from tasks.point.rotation import pose_moved_by
from tasks.rest import REST_PX, rest_of
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
Progress = Callable[[str, int, str], None]

# The limit of the range's change is so many sigmas of it.
LIMIT_SIGMAS = 3.0


class LimbRangeSettings(BaseModel):
    """stop_px: the loop ends when neither limb nor centre moves by more, or by more than half their formal error.
    rest_px: or when both go to and fro within so much, or their error, of the middle of their way, which is then taken.
    limit: largest change of the range factor; a third of it is taken for the start's 1-sigma, so that an arc too
    short to tell the range from the centre keeps it. centre_px, radius_px: errors of the centre (each coordinate) and
    of the disk's radius by photometric law, blur and map, which the segments' scatter does not show, 1-sigma; measured
    on simulated images of other laws and maps (docs/method/uncertainty.md). across: sub-pixels of the simulated disk,
    at most; None leaves them to the scene."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    stop_px: float = Field(0.02, gt=0)
    rest_px: float = Field(REST_PX, ge=0)
    max_iterations: int = Field(12, ge=1, le=100)
    limit: float = Field(0.06, gt=0, lt=0.5)
    centre_px: float = Field(0.09, ge=0)
    radius_px: float = Field(0.10, ge=0)
    across: float | None = Field(None, gt=0)
    edges: LimbSettings = LimbSettings()


def find_range_by_limb(
    observation: Observation, pose: Pose, scene: Scene, settings: LimbRangeSettings, progress: Progress | None = None
) -> Correction:
    """Correct distance and pointing together by least squares on limb segments, rendering again until nothing moves.

    Raises FailedError when too little limb is measured, the loop does not settle, or the range leaves the limit.
    """
    camera, corrected = scene.camera, pose
    history: list[list[float]] = []
    for iteration in range(1, settings.max_iterations + 1):
        seen = scene if settings.across is None else scene.coarser(corrected, settings.across)
        match = match_scene(observation, seen, corrected)
        edges = measure_limb(match, settings.edges)
        centre = camera.project(corrected.target_in_camera_km)
        needed = settings.edges.points_needed(disk_radius_px(corrected, camera, scene.target))
        fit = fit_limb(edges, centre, solve_growth=True, min_points=needed)
        fit = with_range_known(fit, float(np.log(pose.range_km / corrected.range_km)), settings.limit / LIMIT_SIGMAS)
        corrected = pose_moved_by(corrected, camera, fit.offset_px).with_range_factor(1 / (1 + fit.growth))
        radius = disk_radius_px(pose, camera, scene.target)
        moved = max(float(np.hypot(*fit.offset_px)), abs(fit.growth) * radius)
        # Segments come and go between renders: below its own error the fit only wanders.
        noise_px = float(np.sqrt(fit.noise_covariance[2, 2])) * radius / 2
        history.append([*fit.offset_px.tolist(), fit.growth])
        factor = corrected.range_km / pose.range_km
        if progress:
            progress("range", iteration, f"factor {factor:.5f}, moved {moved:.3f} px")
        if abs(factor - 1) > settings.limit:
            raise FailedError(
                Reason.RANGE_OUT_OF_BOUNDS,
                f"the limb gives a range factor of {factor:.4f}, more than {settings.limit:g} from 1.",
                "Check range, Sun direction and the target's radii, or raise the profile's range.limb.limit.",
            )
        if moved < max(settings.stop_px, noise_px):
            return _correction(pose, corrected, scene, fit, history, settings)
        moves = [(x, y, growth * radius) for x, y, growth in history]
        rest = rest_of(moves, max(settings.rest_px, 2 * noise_px))
        if rest is not None:
            back = pose_moved_by(corrected, camera, rest.back[:2])
            back = back.with_range_factor(1 / (1 + float(rest.back[2]) / radius))
            scatter = rest.scatter / (1, 1, radius)
            fit = replace(fit, covariance=fit.covariance + np.diag(scatter**2))
            return _correction(pose, back, scene, fit, history, settings)
    raise FailedError(
        Reason.DID_NOT_CONVERGE,
        f"range and pointing by the limb did not settle in {settings.max_iterations} iterations; "
        f"growths were {', '.join(f'{step[2]:.5f}' for step in history)}.",
        "Check range and Sun direction: where they are far off, the lit limb is not where it is looked for.",
    )


def with_range_known(fit: LimbFit, grown: float, sigma: float) -> LimbFit:
    """The fit with the disk's size at the start weighed in, as of 1-sigma `sigma`, relative (one step of a Kalman
    filter). grown: logarithm of how much the disk has grown since."""
    surplus, known = grown + fit.growth, []
    for covariance in (fit.covariance, fit.noise_covariance):
        gain = covariance[:, 2] / (covariance[2, 2] + sigma**2)
        known.append((gain, covariance - np.outer(gain, covariance[2])))
    (gain, covariance), (_, noise) = known
    offset = fit.offset_px - gain[:2] * surplus
    growth = fit.growth - float(gain[2]) * surplus
    return replace(fit, offset_px=offset, growth=growth, covariance=covariance, noise_covariance=noise)


def _correction(
    pose: Pose,
    corrected: Pose,
    scene: Scene,
    fit: LimbFit,
    history: list[list[float]],
    settings: LimbRangeSettings,
) -> Correction:
    camera = scene.camera
    offset = camera.project(corrected.target_in_camera_km) - camera.project(pose.target_in_camera_km)
    covariance = errors_of(fit, scene, corrected, settings)
    sigma, formal = (np.sqrt(np.diag(matrix)) for matrix in (covariance, fit.noise_covariance))
    evidence: dict[str, Any] = {
        "method": "limb",
        "history": history,
        "residual_px": fit.residual_px,
        "unknowns": ["x", "y", "range"],
        "covariance": covariance.tolist(),
        FORMAL: {"range_factor": float(formal[2]), "offset_px": formal[:2].tolist()},
    }
    return Correction(
        step="range",
        pose=corrected,
        changed={"range_factor": corrected.range_km / pose.range_km, "offset_px": offset.tolist()},
        uncertainty={"range_factor": float(sigma[2]), "offset_px": sigma[:2].tolist()},
        evidence=evidence,
    )


def errors_of(fit: LimbFit, scene: Scene, pose: Pose, settings: LimbRangeSettings) -> Array:
    """Covariance (3, 3) of the centre, px, and the logarithm of the range: of the edges, of the body's relief and
    radius, of the focal length, and of what the edges' scatter does not show. A disk that grows is nearer, and a lit
    arc trades one for the other."""
    target, radius = scene.target, disk_radius_px(pose, scene.camera, scene.target)
    relief_px = target.expected_relief_km / target.mean_radius_km * radius
    sign = np.array([1.0, 1.0, -1.0])
    covariance = (fit.covariance + relief_covariance(fit.design, fit.angle_deg, relief_px)) * np.outer(sign, sign)
    scale = np.hypot(scene.camera.focal_length_sigma, (target.radius_sigma_km or 0.0) / target.mean_radius_km)
    of_range = np.hypot(settings.radius_px / radius, scale)
    return np.asarray(covariance + np.diag([settings.centre_px, settings.centre_px, of_range]) ** 2)
