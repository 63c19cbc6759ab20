"""Range: scan a factor on the distance and keep the one whose simulation is most similar (paper, section 3.2)."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.compare.brightness import brightness_columns, fit_brightness, robust_least_squares
from tasks.compare.match import Match, framed_window, match_scene
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.compare.similarity import SsimSettings, ssim
from tasks.correction import FORMAL, Correction
from tasks.point.registration.least_squares import gauss_newton_step, moved
from tasks.point.rotation import pose_moved_by
from tasks.simulate import Scene

Progress = Callable[[str, int, str], None]


# Of the scan, which only says where to look, and of the error; not of the renders that the answer comes from.
SCAN_OVERSAMPLE = 2
# A step this small leaves nothing for another.
NEAR_PX = 0.02


class ScanSettings(BaseModel):
    """low, high, step: the paper's scan of 0.99-1.01; it is widened by `widen` at a time, at most to `limit` from 1,
    while the best factor is at an edge. refine_step: spacing of the three fresh renders that the parabola goes through.
    diameter_px: larger disks are compared at reduced resolution. must_settle: false leaves the range as it is when the
    similarity has no maximum, for a later pass to find by other means; else that is a failure. index: what similarity
    is."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    low: float = Field(0.99, gt=0)
    high: float = Field(1.01, gt=0)
    step: float = Field(0.0005, gt=0)
    widen: float = Field(0.01, gt=0)
    limit: float = Field(0.06, gt=0, lt=0.5)
    refine_step: float = Field(0.0015, gt=0)
    max_refinements: int = Field(6, ge=1)
    diameter_px: float = Field(300.0, gt=0)
    must_settle: bool = True
    index: SsimSettings = SsimSettings()


class NoMaximumError(FailedError):
    """The similarity has no maximum where it was looked for."""


@dataclass(frozen=True)
class Trial:
    """One tried factor: the similarity there after the offset was re-solved, and that offset (2,), px."""

    factor: float
    similarity: float
    offset_px: NDArray[np.float64]


def find_range_by_similarity(
    observation: Observation, pose: Pose, scene: Scene, settings: ScanSettings, progress: Progress | None = None
) -> Correction:
    """Correct the distance to the target along the line of sight.

    At every factor the offset is solved again: a wrong distance moves the lit limb, and a fit that holds the centre
    would pay for it in range. The coarse scan scales one rendered image (a change of distance of per cents is a change
    of scale to 1e-5); the optimum is then refined on fresh renders.

    Raises FailedError when the similarity has no maximum within the limit; unless it need not settle: then the pose
    comes back unchanged, not converged, with the reason in the evidence.
    """
    try:
        return found_range(observation, pose, scene, settings, progress)
    except NoMaximumError as error:
        if settings.must_settle:
            raise
        if progress:
            progress("range", 1, f"left as it is: {error.fault}")
        evidence = {"method": "ssim", "undetermined": error.fault}
        return Correction("range", pose, {"range_factor": None}, {"range_factor": None}, evidence, converged=False)


def found_range(
    observation: Observation, pose: Pose, scene: Scene, settings: ScanSettings, progress: Progress | None
) -> Correction:
    """Scan, then refine. Raises NoMaximumError."""
    camera = scene.camera
    n = reduction_for(pose, scene, settings.diameter_px)
    observation, scene = reduced_observation(observation, n), reduced_scene(scene, n)
    rough = replace(scene, settings=scene.settings.model_copy(update={"oversample": SCAN_OVERSAMPLE}))
    match = match_scene(observation, rough, pose, framed_window(scene, pose.with_range_factor(1 - settings.limit)))
    trials, widened = scan(match, settings)
    best = max(trials, key=lambda trial: trial.similarity)
    if progress:
        progress("range", 1, f"scan of {len(trials)} factors: {best.factor:.4f}")
    refined, curvature = refine(observation, pose, scene, best, settings, progress)
    before = min(trials, key=lambda trial: abs(trial.factor - 1.0))
    corrected = pose_moved_by(pose, scene.camera, refined.offset_px).with_range_factor(refined.factor)
    moved_px = camera.project(corrected.target_in_camera_km) - camera.project(pose.target_in_camera_km)
    evidence: dict[str, Any] = {
        "method": "ssim",
        "reduction": n,
        "scan": [[round(float(t.factor), 6), round(t.similarity, 6)] for t in trials],
        "widened": widened,
        "similarity_before": before.similarity,
        "similarity_after": refined.similarity,
        "curvature": curvature,
        FORMAL: {"range_factor": radial_sigma(match_scene(observation, rough, corrected))},
    }
    return Correction(
        step="range",
        pose=corrected,
        changed={"range_factor": float(refined.factor), "offset_px": moved_px.tolist()},
        # The formal one is of the pixels' scatter alone; the similarity's bias by shading and blur, which nothing in
        # the image tells, is some 70 times larger (docs/method/range.md).
        uncertainty={"range_factor": None},
        evidence=evidence,
    )


def scan(match: Match, settings: ScanSettings) -> tuple[list[Trial], bool]:
    """Similarity over the grid of factors, widened while the best is at an edge; trials sorted by factor."""
    low, high = settings.low, settings.high
    factors = np.arange(low, high + settings.step / 2, settings.step)
    trials = [scaled_trial(match, factor, settings.index) for factor in factors]
    widened = False
    while True:
        best = int(np.argmax([trial.similarity for trial in trials]))
        if 0 < best < len(trials) - 1:
            return trials, widened
        widened = True
        low_side = best == 0
        if abs((low if low_side else high) - 1) >= settings.limit - 1e-9:
            raise NoMaximumError(
                Reason.RANGE_OUT_OF_BOUNDS,
                f"the similarity still grows at range factor {trials[best].factor:.4f}, the limit of the scan.",
                "Check the range and the target's radii, or widen the profile's range.limit.",
            )
        if low_side:
            added = np.arange(low - settings.widen, low - settings.step / 2, settings.step)
            trials = [*(scaled_trial(match, f, settings.index) for f in added), *trials]
            low -= settings.widen
        else:
            added = np.arange(high + settings.step, high + settings.widen + settings.step / 2, settings.step)
            trials = [*trials, *(scaled_trial(match, f, settings.index) for f in added)]
            high += settings.widen


def scaled_trial(match: Match, factor: float, index: SsimSettings) -> Trial:
    """Similarity after scaling the simulated bases about the target's centre by 1 / factor."""
    import cv2

    ny, nx = match.image.shape
    scale, centre_px = 1.0 / factor, match.centre_px
    transform = np.array([[scale, 0, centre_px[0] * (1 - scale)], [0, scale, centre_px[1] * (1 - scale)]])
    bases = np.stack(
        [
            cv2.warpAffine(b, transform, (nx, ny), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
            for b in match.simulation.bases
        ]
    )
    return trial_of(match, bases, factor, index)


def trial_of(match: Match, bases: NDArray[np.float32], factor: float, index: SsimSettings) -> Trial:
    """Solve the offset (two Gauss-Newton steps) and brightness for `bases`, then measure the similarity."""
    offset = np.zeros(2)
    for _ in range(2):
        step, _ = gauss_newton_step(match.image, match.weight, np.stack([moved(b, offset) for b in bases]))
        offset = offset + np.clip(step, -3, 3)
        if np.abs(step).max() < NEAR_PX:
            break
    model, _ = fit_brightness(match, np.stack([moved(b, offset) for b in bases]))
    return Trial(factor, ssim(match.image, model, match.usable, index), offset)


def refine(
    observation: Observation,
    pose: Pose,
    scene: Scene,
    start: Trial,
    settings: ScanSettings,
    progress: Progress | None,
) -> tuple[Trial, float]:
    """Maximum of a parabola through fresh renders around `start`; moves on while the maximum is at an end.

    Scaled images are a little blurred except at factor 1, which would draw the maximum there; renders are not.
    """
    # One window for all, so that every factor is judged on the same pixels.
    window = framed_window(scene, pose.with_range_factor(start.factor - 4 * settings.refine_step))
    rendered: dict[int, Trial] = {}

    def at(index: int) -> Trial:
        if index not in rendered:
            factor = start.factor + index * settings.refine_step
            moved_pose = pose_moved_by(pose, scene.camera, start.offset_px).with_range_factor(factor)
            match = match_scene(observation, scene, moved_pose, window)
            trial = trial_of(match, match.simulation.bases, factor, settings.index)
            rendered[index] = Trial(factor, trial.similarity, start.offset_px + trial.offset_px)
            if progress:
                progress("range", 1 + len(rendered), f"factor {factor:.5f}: similarity {trial.similarity:.5f}")
        return rendered[index]

    middle = 0
    for _ in range(settings.max_refinements):
        left, here, right = at(middle - 1), at(middle), at(middle + 1)
        if here.similarity >= max(left.similarity, right.similarity):
            break
        middle += -1 if left.similarity > right.similarity else 1
    else:
        raise NoMaximumError(
            Reason.RANGE_UNSETTLED,
            f"the similarity has no clear maximum near its best scanned factor {start.factor:.4f}.",
            "Check Sun direction and base map, or take the range from the limb (range.method of the profile).",
        )
    curvature = left.similarity - 2 * here.similarity + right.similarity
    lean = 0.0 if curvature >= 0 else 0.5 * (left.similarity - right.similarity) / curvature
    other = right if lean > 0 else left
    offset = here.offset_px + abs(lean) * (other.offset_px - here.offset_px)
    top = here.similarity - 0.25 * (left.similarity - right.similarity) * lean
    return Trial(here.factor + lean * settings.refine_step, top, offset), curvature / settings.refine_step**2


def radial_sigma(match: Match) -> float:
    """1-sigma of the range factor from least squares with offset and brightness solved along; scaled by residuals."""
    model, _ = fit_brightness(match, match.simulation.bases)
    d_row, d_column = np.gradient(model)
    y, x = np.mgrid[: model.shape[0], : model.shape[1]]
    radial = d_column * (x - match.centre_px[0]) + d_row * (y - match.centre_px[1])
    moves = np.stack([-d_column, -d_row, radial]).astype(np.float32)
    columns = np.concatenate([brightness_columns(match.simulation.bases), moves])
    _, covariance, _ = robust_least_squares(columns, match.image, match.weight)
    return float(np.sqrt(max(covariance[-1, -1], 0)))
