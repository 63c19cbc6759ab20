"""Range from the lit limb: the growth that puts the simulated limb on the image's, solved with the offset."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.limb_edges import LimbSettings, measure_limb
from tasks.compare.limb_errors import relief_covariance
from tasks.compare.limb_fit import LimbFit, fit_limb
from tasks.compare.match import match_scene
from tasks.correction import Correction
from tasks.joint.parameters import NAMES
from tasks.joint.uncertainty import of_the_body
from tasks.point.rotation import pose_moved_by
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
Progress = Callable[[str, int, str], None]


class LimbRangeSettings(BaseModel):
    """stop_px: the loop ends when neither limb nor centre moves by more, or by more than half their error.
    limit: largest change of the range factor. across: sub-pixels of the simulated disk, at most; None leaves
    them to the scene."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    stop_px: float = Field(0.02, gt=0)
    max_iterations: int = Field(12, ge=1, le=100)
    limit: float = Field(0.06, gt=0, lt=0.5)
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
        fit = fit_limb(edges, centre, solve_growth=True, min_points=settings.edges.min_points)
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
                "range-out-of-bounds",
                f"the limb asks for a range factor of {factor:.4f}, more than {settings.limit:g} from 1.",
                "Check range, Sun direction and the target's radii, or raise the profile's range.limb.limit.",
            )
        if moved < max(settings.stop_px, noise_px):
            return _correction(pose, corrected, scene, fit, history)
    raise FailedError(
        "did-not-converge",
        f"range and pointing by the limb did not settle in {settings.max_iterations} iterations; "
        f"growths were {', '.join(f'{step[2]:.5f}' for step in history)}.",
        "Check range and Sun direction: where they are far off, the lit limb is not where it is looked for.",
    )


def _correction(pose: Pose, corrected: Pose, scene: Scene, fit: LimbFit, history: list[list[float]]) -> Correction:
    camera = scene.camera
    offset = camera.project(corrected.target_in_camera_km) - camera.project(pose.target_in_camera_km)
    covariance = errors_of(fit, scene, corrected)
    sigma = np.sqrt(np.diag(covariance))
    evidence: dict[str, Any] = {
        "method": "limb",
        "history": history,
        "residual_px": fit.residual_px,
        "unknowns": ["x", "y", "range"],
        "covariance": covariance.tolist(),
    }
    return Correction(
        step="range",
        pose=corrected,
        changed={"range_factor": corrected.range_km / pose.range_km, "offset_px": offset.tolist()},
        uncertainty={"range_factor": float(sigma[2]), "offset_px": sigma[:2].tolist()},
        evidence=evidence,
    )


def errors_of(fit: LimbFit, scene: Scene, pose: Pose) -> Array:
    """Covariance (3, 3) of the centre, px, and the logarithm of the range: of the edges, and of the body's relief and
    radius. A disk that grows is nearer, and a lit arc trades one for the other."""
    radius = disk_radius_px(pose, scene.camera, scene.target)
    relief_px = scene.target.expected_relief_km / scene.target.mean_radius_km * radius
    sign = np.array([1.0, 1.0, -1.0])
    covariance = (fit.covariance + relief_covariance(fit.design, fit.angle_deg, relief_px)) * np.outer(sign, sign)
    body = of_the_body(scene.target, radius, response=np.zeros((len(NAMES), 1)))
    return np.asarray(covariance + body[:3, :3])
