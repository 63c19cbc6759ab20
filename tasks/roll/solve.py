"""Roll: turn the camera about the line of sight until the disk is turned as in the image.

For one disk a roll of the camera and a turn of the target about the line of sight move the markings alike. What tells
them apart is what does not turn with the target: the direction to the Sun (terminator, shading, lit limb), a flattened
limb. Near phase 0 nothing does, and the result says to which of the two a turn was assigned without being told.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.brightness import correlation, fit_brightness
from tasks.compare.match import Match, match_scene
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.correction import Correction
from tasks.point.registration.least_squares import register_least_squares
from tasks.point.rotation import pose_moved_by
from tasks.roll.refine import CAMERA, TARGET, TurnStep, turn_step
from tasks.roll.scan import polar_scan
from tasks.roll.turns import camera_rolled, target_turned
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Progress = Callable[[str, int, str], None]
Photometry = Literal["lambert", "lommel-seeliger", "lunar-lambert", "mixture"]
TURNS = {CAMERA: camera_rolled, TARGET: target_turned}
OVERSAMPLE = 2


class RollSettings(BaseModel):
    """assign: `image` lets the image say how much of a turn is the camera's roll and how much the target's, where the
    Sun's direction tells them apart, and takes it for the camera's where not; `camera`, `target`: all of it.

    reach_deg: largest turn that is looked for, 0 to start near 0. min_gain: rise of the correlation that makes a far
    start believed. apply_from_deg: smaller rolls are reported, and left for the attitude to take up. max_sigma_deg: a
    turn less sure is not determined; tell_sigma_deg: both turns must be surer than this, solved together, to be told
    apart. photometry: of the simulations, None takes the profile's. diameter_px: larger disks are compared at reduced
    resolution. stop_deg: the loop ends at a smaller step, or
    one below half its error."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    assign: Literal["image", "camera", "target"] = "image"
    reach_deg: float = Field(45.0, ge=0, le=180)
    min_gain: float = Field(0.005, ge=0)
    apply_from_deg: float = Field(0.0, ge=0)
    max_sigma_deg: float = Field(0.5, gt=0)
    tell_sigma_deg: float = Field(0.5, gt=0)
    photometry: Photometry | None = "mixture"
    diameter_px: float = Field(200.0, gt=0)
    stop_deg: float = Field(0.01, gt=0)
    max_iterations: int = Field(12, ge=1, le=100)


@dataclass
class State:
    """Where the solution stands: the pose, the turns so far by kind, the last step and all moves."""

    pose: Pose
    turns_deg: dict[str, float] = field(default_factory=lambda: {CAMERA: 0.0, TARGET: 0.0})
    step: TurnStep | None = None
    history: list[dict[str, float]] = field(default_factory=list)

    def turned(self, kind: str, angle_deg: float) -> None:
        """Turn camera or target by so much more."""
        self.pose = TURNS[kind](self.pose, angle_deg)
        self.turns_deg[kind] += angle_deg


def find_roll(
    observation: Observation, pose: Pose, scene: Scene, settings: RollSettings, progress: Progress | None = None
) -> Correction:
    """Correct the camera's roll, and what the image assigns to the target's turn about the line of sight.

    changed: `roll_deg` and `turn_deg` (picture turned from +x towards +y, by the camera and by the target), None when
    the image cannot tell; then the pose is returned unchanged and the evidence has the reason. evidence: `assigned_to`
    (camera, target, both) and `told_apart_by` (sun, or setting when nothing tells).
    """
    n = reduction_for(pose, scene, settings.diameter_px)
    small = reduced_observation(observation, n)
    # One law, when it is not the surface's, leaves a shading that passes for turned markings.
    changes = {"oversample": OVERSAMPLE, "photometry": settings.photometry or scene.settings.photometry}
    scene = reduced_scene(replace(scene, settings=scene.settings.model_copy(update=changes)), n)
    radius = disk_radius_px(pose, scene.camera, scene.target)
    state = State(pose)
    evidence: dict[str, Any] = {"reduction": n, "phase_deg": pose.phase_deg}
    before = likeness(match_scene(small, scene, pose))
    if settings.reach_deg > 0:
        evidence["scan"] = start_from_afar(state, small, scene, settings)
        if progress:
            progress("roll", 0, f"scan: {evidence['scan']}")
    kinds = kinds_of(settings)
    settled = refine(state, small, scene, kinds, radius, settings, progress)
    told = len(kinds) == 2
    if told and not are_told_apart(state.step, settings):
        # Together they are not determined: all of it goes to the camera.
        evidence["not_told_apart"] = told_in_words(state.step)
        turn = state.turns_deg[TARGET] + state.turns_deg[CAMERA]
        state = State(camera_rolled(pose, turn), {CAMERA: turn, TARGET: 0.0}, None, state.history)
        told, kinds = False, (CAMERA,)
        settled = refine(state, small, scene, kinds, radius, settings, progress)
    after = likeness(match_scene(small, scene, state.pose))
    evidence |= {
        "assigned_to": "both" if len(kinds) == 2 else kinds[0],
        "told_apart_by": "sun" if told else "setting",
        "history": state.history,
        "settled": settled,
        "correlation_before": before,
        "correlation_after": after,
    }
    return verdict(pose, state, scene, settings, evidence)


def kinds_of(settings: RollSettings) -> tuple[str, ...]:
    """The turns to solve."""
    return (CAMERA, TARGET) if settings.assign == "image" else (settings.assign,)


def start_from_afar(state: State, observation: Observation, scene: Scene, settings: RollSettings) -> dict[str, Any]:
    """Turn the state to the best angle of the polar scan, when that is clearly better than none, and point anew."""
    scan = polar_scan(match_scene(observation, scene, state.pose), settings.reach_deg)
    kinds = kinds_of(settings)
    best = {kind: scan.best(kind) for kind in kinds}
    kind = max(kinds, key=lambda kind: best[kind][1])
    here = float(scan.camera[len(scan.camera) // 2])
    taken = best[kind][1] > here + settings.min_gain
    if taken:
        state.turned(kind, best[kind][0])
        match = match_scene(observation, scene, state.pose)
        state.pose = pose_moved_by(state.pose, scene.camera, register_least_squares(match).offset_px)
    figures = {name: {"angle_deg": angle, "correlation": round(score, 4)} for name, (angle, score) in best.items()}
    return {"unturned": round(here, 4), **figures, "taken": kind if taken else None}


def refine(
    state: State,
    observation: Observation,
    scene: Scene,
    kinds: tuple[str, ...],
    radius_px: float,
    settings: RollSettings,
    progress: Progress | None,
) -> bool:
    """Gauss-Newton steps with a new simulation each; whether they came to rest."""
    for iteration in range(1, settings.max_iterations + 1):
        step = turn_step(match_scene(observation, scene, state.pose), kinds, radius_px)
        state.step = step
        limit_deg = np.degrees(3.0 / radius_px)
        state.pose = pose_moved_by(state.pose, scene.camera, np.clip(step.offset_px, -3, 3))
        for kind, angle in step.turns_deg.items():
            state.turned(kind, float(np.clip(angle, -limit_deg, limit_deg)))
        state.history.append({**step.turns_deg, "offset_px": float(np.hypot(*step.offset_px))})
        if progress:
            progress("roll", iteration, ", ".join(f"{kind} {angle:+.3f} deg" for kind, angle in step.turns_deg.items()))
        still = all(abs(a) <= max(settings.stop_deg, step.sigma_deg[k] / 2) for k, a in step.turns_deg.items())
        if still and np.hypot(*step.offset_px) < 0.05:
            return True
    return False


def are_told_apart(step: TurnStep | None, settings: RollSettings) -> bool:
    """Whether the two turns, solved together, are both determined."""
    return step is not None and max(step.sigma_deg.values()) < settings.tell_sigma_deg


def told_in_words(step: TurnStep | None) -> str:
    """How sure the two turns were, solved together."""
    if step is None:
        return "not solved"
    sigmas = ", ".join(f"{kind} {sigma:.2f} deg" for kind, sigma in step.sigma_deg.items())
    return f"1-sigma {sigmas}, correlation {step.correlation:+.3f}"


def verdict(pose: Pose, state: State, scene: Scene, settings: RollSettings, evidence: dict[str, Any]) -> Correction:
    """The correction, or the unchanged pose with the reason."""
    step = state.step
    sigma: dict[str, float | None] = {CAMERA: None, TARGET: None, **(step.sigma_deg if step else {})}
    errors = {"roll_deg": sigma[CAMERA], "turn_deg": sigma[TARGET]}
    turns = state.turns_deg
    evidence |= {"found_deg": dict(turns), "sigma_deg": errors}
    reason = None
    if step is None or max(step.sigma_deg.values()) > settings.max_sigma_deg:
        reason = f"the turn is uncertain ({told_in_words(step)}; limit {settings.max_sigma_deg} deg)"
    elif not evidence["settled"]:
        reason = f"it did not come to rest in {settings.max_iterations} steps"
    elif evidence["correlation_after"] < evidence["correlation_before"] - 1e-3:
        reason = "the turn makes image and simulation less alike"
    elif max(abs(turn) for turn in turns.values()) < settings.apply_from_deg:
        reason = f"smaller than {settings.apply_from_deg} deg, which the attitude takes up"
    if reason:
        evidence["left"] = reason
        nothing = {"roll_deg": None, "turn_deg": None}
        return Correction("roll", pose, nothing, nothing, evidence, bool(evidence["settled"]))
    moved_px = scene.camera.project(state.pose.target_in_camera_km) - scene.camera.project(pose.target_in_camera_km)
    changed = {
        "roll_deg": turns[CAMERA],
        "turn_deg": turns[TARGET],
        "offset_px": (evidence["reduction"] * moved_px).tolist(),
    }
    return Correction("roll", state.pose, changed, errors, evidence)


def likeness(match: Match) -> float:
    """Correlation of image and brightness-fitted simulation."""
    model, _ = fit_brightness(match, match.simulation.bases)
    return correlation(match.image, model, match.usable)
