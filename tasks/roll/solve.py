"""Roll: turn the camera about the line of sight until the disk is turned as in the image.

For one disk a roll of the camera and a turn of the target about the line of sight move the markings alike. What tells
them apart is what does not turn with the target: the direction to the Sun (terminator, shading, lit limb), a flattened
limb. So both are tried, and the one that makes the simulation more like the image is taken. Near phase 0 neither does,
and the result says to which of the two a turn was assigned without evidence.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.bodies.masks import alone
from tasks.compare.brightness import correlation, fit_brightness
from tasks.compare.match import Match, match_scene
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.correction import FORMAL, Correction
from tasks.point.registration.least_squares import register_least_squares
from tasks.point.rotation import pose_moved_by
from tasks.rest import REST_PX, rest_of
from tasks.roll.refine import CAMERA, TARGET, turn_step
from tasks.roll.scan import PolarScan, polar_scan
from tasks.roll.turns import camera_rolled, target_turned
from tasks.simulate import Scene
from tasks.simulate.photometry import BasisName
from tasks.simulate.window import disk_radius_px

Progress = Callable[[str, int, str], None]
TURNS = {CAMERA: camera_rolled, TARGET: target_turned}
OVERSAMPLE = 2
STILL_PX = 0.05
SMALL_DEG, HARM = 2.0, 2e-3
MIN_CONTRAST = 0.3
SCAN_ERROR_DEG = 0.9


class RollSettings(BaseModel):
    """assign: `image` takes a turn for the camera's or the target's by which explains the image better, and for the
    camera's when neither clearly does; `camera`, `target`: in any case.

    reach_deg: largest turn that is looked for, 0 to start near 0. min_gain: the part of what the simulation does not
    explain (1 - correlation^2) that a turn must explain to be accepted, and by which one must beat the other to be
    named apart. apply_from_deg: smaller turns are reported, and left for the attitude to take up. max_sigma_deg: a turn
    less sure is not determined. photometry: of the simulations, None takes the profile's. diameter_px: larger disks are
    compared at reduced resolution. stop_deg: the loop ends at a smaller step, or one below half its error. rest_px: or
    when limb and centre go to and fro within so much, or within their error, of the middle of their way."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    assign: Literal["image", "camera", "target"] = "image"
    reach_deg: float = Field(45.0, ge=0, le=180)
    min_gain: float = Field(0.1, ge=0, lt=1)
    apply_from_deg: float = Field(0.0, ge=0)
    max_sigma_deg: float = Field(0.5, gt=0)
    photometry: BasisName | None = "mixture"
    diameter_px: float = Field(150.0, gt=0)
    stop_deg: float = Field(0.02, gt=0)
    rest_px: float = Field(REST_PX, ge=0)
    max_iterations: int = Field(10, ge=1, le=100)


@dataclass
class Trial:
    """One explanation: a turn of `kind`. pose and turn_deg so far, its error, all steps (degrees), whether it came to
    rest, and how much the image and its simulation then correlate."""

    kind: str
    pose: Pose
    turn_deg: float = 0.0
    sigma_deg: float = float("inf")
    history: list[float] = field(default_factory=list)
    settled: bool = False
    correlation: float = 0.0

    def turned(self, angle_deg: float) -> None:
        """Turn camera or target by so much more."""
        self.pose = TURNS[self.kind](self.pose, angle_deg)
        self.turn_deg += angle_deg

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        names = ("turn_deg", "sigma_deg", "settled", "correlation", "history")
        return {name: getattr(self, name) for name in names}


def find_roll(
    observation: Observation, pose: Pose, scene: Scene, settings: RollSettings, progress: Progress | None = None
) -> Correction:
    """Correct a turn of the picture about the line of sight, by rolling the camera or turning the target.

    changed: `roll_deg` and `turn_deg` (picture turned from +x towards +y, by the camera and by the target; one of them
    is 0), None when the image cannot tell; then the pose is returned unchanged and the evidence has the reason under
    `left`. evidence: `assigned_to` (camera or target), `decided_by` (image, or setting), and both trials.
    """
    observation = alone(observation, pose, scene)
    n = reduction_for(pose, scene, settings.diameter_px)
    small = reduced_observation(observation, n)
    # One law, when it is not the surface's, leaves a shading that passes for turned markings.
    changes = {"oversample": OVERSAMPLE, "photometry": settings.photometry or scene.settings.photometry}
    scene = reduced_scene(replace(scene, settings=scene.settings.model_copy(update=changes)), n)
    kinds = (CAMERA, TARGET) if settings.assign == "image" else (settings.assign,)
    here = match_scene(small, scene, pose)
    before = likeness(here)
    scan = polar_scan(here, settings.reach_deg) if settings.reach_deg > 0 else None
    if scan is not None and not any(may_be_large(scan, kind, settings) for kind in kinds):
        reason = f"the scan finds no turn near {settings.apply_from_deg} deg; the attitude takes up smaller ones"
        best_angles = {kind: scan.best(kind) for kind in kinds}
        nothing = {"roll_deg": None, "turn_deg": None}
        return Correction("roll", pose, nothing, nothing, {"reduction": n, "scan": best_angles, "left": reason})
    trials = {kind: tried(kind, pose, small, scene, settings, scan, progress) for kind in kinds}
    best = max(trials.values(), key=lambda trial: trial.correlation)
    decided = len(kinds) == 1 or explains_more(best.correlation, min(t.correlation for t in trials.values()), settings)
    if not decided:
        best = trials[CAMERA]
    evidence: dict[str, Any] = {
        "reduction": n,
        "phase_deg": pose.phase_deg,
        "scan": None if scan is None else {kind: scan.best(kind) for kind in kinds},
        "scan_contrast": None if scan is None else scan.contrast(best.kind),
        "assigned_to": best.kind,
        "decided_by": "image" if decided and len(kinds) == 2 else "setting",
        "trials": {kind: trial.to_dict() for kind, trial in trials.items()},
        "correlation_before": before,
        "correlation_after": best.correlation,
        "settled": best.settled,
    }
    return verdict(pose, best, scene, settings, evidence)


def may_be_large(scan: PolarScan, kind: str, settings: RollSettings) -> bool:
    """Whether the scan leaves it open that a turn is as large as it must be to be applied."""
    angle_deg, correlation = scan.best(kind)
    if abs(angle_deg) + SCAN_ERROR_DEG < settings.apply_from_deg:
        return False
    return settings.apply_from_deg == 0 or explains_more(correlation, scan.unturned, settings)


def tried(
    kind: str,
    pose: Pose,
    observation: Observation,
    scene: Scene,
    settings: RollSettings,
    scan: PolarScan | None,
    progress: Progress | None,
) -> Trial:
    """The best turn of `kind`: from the scan's best angle where that is clearly better than none, by Gauss-Newton steps
    with a new simulation each."""
    trial = Trial(kind, pose)
    if scan is not None:
        angle_deg, correlation = scan.best(kind)
        if explains_more(correlation, scan.unturned, settings):
            trial.turned(angle_deg)
            match = match_scene(observation, scene, trial.pose)
            trial.pose = pose_moved_by(trial.pose, scene.camera, register_least_squares(match).offset_px)
    radius_px = disk_radius_px(pose, scene.camera, scene.target)
    limit_deg = float(np.degrees(3.0 / radius_px))
    moves: list[tuple[float, ...]] = []
    for iteration in range(1, settings.max_iterations + 1):
        step = turn_step(match_scene(observation, scene, trial.pose), kind, radius_px)
        trial.pose = pose_moved_by(trial.pose, scene.camera, np.clip(step.offset_px, -3, 3))
        trial.turned(float(np.clip(step.turn_deg, -limit_deg, limit_deg)))
        trial.sigma_deg = step.sigma_deg
        trial.history.append(step.turn_deg)
        if progress:
            progress("roll", iteration, f"{kind} {step.turn_deg:+.3f} deg")
        still = abs(step.turn_deg) <= max(settings.stop_deg, step.sigma_deg / 2)
        if still and np.hypot(*step.offset_px) < STILL_PX:
            trial.settled = True
            break
        turn_px = np.radians(step.turn_deg) * radius_px
        moves.append((turn_px, *step.offset_px))
        rest = rest_of(moves, max(settings.rest_px, float(np.radians(step.sigma_deg)) * radius_px))
        if rest is not None:
            trial.pose = pose_moved_by(trial.pose, scene.camera, rest.back[1:])
            trial.turned(float(np.degrees(rest.back[0] / radius_px)))
            trial.sigma_deg = float(np.hypot(step.sigma_deg, np.degrees(rest.scatter[0] / radius_px)))
            trial.settled = True
            break
    trial.correlation = likeness(match_scene(observation, scene, trial.pose))
    return trial


def explains_more(one: float, other: float, settings: RollSettings) -> bool:
    """Whether correlation `one` leaves clearly less of the image unexplained than correlation `other`."""
    left, left_by_other = (1 - max(value, 0.0) ** 2 for value in (one, other))
    return left <= (1 - settings.min_gain) * left_by_other


def is_better(best: Trial, before: float, settings: RollSettings) -> bool:
    """Whether the trial makes image and simulation more alike; a small turn hardly does, so it must only do no harm."""
    if abs(best.turn_deg) > SMALL_DEG:
        return explains_more(best.correlation, before, settings)
    return best.correlation > before - HARM


def verdict(pose: Pose, best: Trial, scene: Scene, settings: RollSettings, evidence: dict[str, Any]) -> Correction:
    """The correction, or the unchanged pose with the reason."""
    reason, contrast = None, evidence["scan_contrast"]
    if contrast is not None and contrast < MIN_CONTRAST:
        reason = f"the disk looks much the same from every side (contrast of the scan {contrast:.2f})"
    elif best.sigma_deg > settings.max_sigma_deg:
        reason = f"the turn is uncertain by {best.sigma_deg:.2f} deg (limit {settings.max_sigma_deg} deg)"
    elif not best.settled:
        reason = f"it did not come to rest in {settings.max_iterations} steps"
    elif abs(best.turn_deg) < settings.apply_from_deg:
        reason = f"smaller than {settings.apply_from_deg} deg, which the attitude takes up"
    elif not is_better(best, evidence["correlation_before"], settings):
        reason = "the turn does not make image and simulation more alike"
    if reason:
        nothing = {"roll_deg": None, "turn_deg": None}
        return Correction("roll", pose, nothing, nothing, evidence | {"left": reason}, best.settled)
    moved_px = scene.camera.project(best.pose.target_in_camera_km) - scene.camera.project(pose.target_in_camera_km)
    is_camera = best.kind == CAMERA
    changed = {
        "roll_deg": best.turn_deg if is_camera else 0.0,
        "turn_deg": 0.0 if is_camera else best.turn_deg,
        "offset_px": (evidence["reduction"] * moved_px).tolist(),
    }
    # Of the pixels' scatter alone: what the target's attitude is off by goes into the turn.
    formal = {"roll_deg" if is_camera else "turn_deg": best.sigma_deg}
    nothing = {"roll_deg": None, "turn_deg": None}
    return Correction("roll", best.pose, changed, nothing, evidence | {FORMAL: formal})


def likeness(match: Match) -> float:
    """Correlation of image and brightness-fitted simulation."""
    model, _ = fit_brightness(match, match.simulation.bases)
    return correlation(match.image, model, match.usable)
