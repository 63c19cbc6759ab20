"""The joint step's answer: the estimate as a correction, with its evidence and why it is doubted."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import POSE_KEYS, Pose
from catalog.reasons import Reason
from tasks.attitude.markings import UNKNOWN_DEG
from tasks.bodies.masks import alone
from tasks.correction import Correction
from tasks.joint.beam_bending import Bending, displacement_of
from tasks.joint.coarse_to_fine import (
    Array,
    Estimate,
    Source,
    estimated,
    is_uniform,
    prior_sigmas,
    second_start,
    without_markings,
)
from tasks.joint.gauss_newton import Solution
from tasks.joint.limb_update import updated_by_limb
from tasks.joint.lost_lines import doubt_of_step
from tasks.joint.orientation import Orientation, Solvers, doubt_of_markings, oriented
from tasks.joint.parameters import ATTITUDE, NAMES, OFFSET, PSF, RANGE, ROLL, State, difference
from tasks.joint.problem import EXACT, DistortionError, Problem, Progress
from tasks.joint.roll_by_others import roll_by_others
from tasks.joint.settings import JointSettings
from tasks.joint.shape import doubt_of_displacement, doubt_of_relief, doubt_of_shape
from tasks.joint.thresholds import PyramidThresholds
from tasks.joint.uncertainty import prior_dominated_directions
from tasks.point.rotation import is_offset_from, pose_facing
from tasks.priors import PriorSettings
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px
from tasks.undistort.resample import displaced

Evidence = dict[str, Any]


def find_pose_jointly(
    observation: Observation,
    pose: Pose,
    predicted: Pose,
    source: Source | Mapping[str, str],
    scene: Scene,
    settings: JointSettings,
    progress: Progress | None = None,
    distortion: DistortionError = EXACT,
    markings_match: bool = True,
    own_priors: PriorSettings | None = None,
) -> Correction:
    """Correct pointing, range, roll and attitude together, with PSF width and photometry solved along.

    pose: where to start. predicted: what the metadata say; the priors are about it. source: where it is from,
    or where each part of it is (keys of `Pose`). markings_match: False where the map's markings are known not to be the
    image's: the attitude is then stated as no better known than by its prior. own_priors: of this predicted pose, in
    place of those of its sources. changed and
    uncertainty: as of the other steps, relative to `pose`, and `psf_sigma_px`, `range_factor_free` (relative to
    `predicted`); None for what was held. `predicted_to_free` of the evidence is None where the predicted pose looks
    elsewhere (see `pose_facing`): no offset in the picture leads there. A target without a map keeps its attitude.
    Raises FailedError when too few pixels are usable.
    """
    whole, observation = observation, alone(observation, pose, scene)
    sources = dict.fromkeys(POSE_KEYS, source) if isinstance(source, str) else source
    priors = own_priors or settings.priors.of(sources, has_map=not is_uniform(scene))
    facing = pose_facing(predicted, pose, scene.camera)
    by_others = None if "roll" in settings.hold else roll_by_others(whole, pose, facing, scene, priors)
    if by_others:
        facing, priors = by_others.predicted(facing), by_others.priors(priors)
    metadata = State(facing, scene.psf_sigma_px)
    sigmas = prior_sigmas(priors, metadata.pose.range_km)
    given = Problem(observation, scene, metadata, sigmas, settings, distortion, progress, priors.sun_deg)
    start = State(pose, scene.psf_sigma_px)
    is_held = "attitude" in settings.hold
    if is_uniform(scene):
        given = without_markings(given)

    def solve(begin: State, without_turn: bool) -> Estimate:
        return estimated(given.with_attitude_held() if without_turn else given, begin)

    def lead(found: Estimate) -> tuple[Estimate, Evidence | None]:
        unbent = observation
        if distortion.bending is not None and found.bending and found.bending.strength:
            unbent = displaced(observation, displacement_of(found.bending.strength, distortion.bending))
        return updated_by_limb(replace(given, observation=unbent), found)

    estimate, led, orientation = oriented(given, Solvers(solve, lead), start, markings_match, is_held)
    away = second_start(given, start, estimate) if settings.second_start else None
    correction = as_correction(given, estimate, start, away, led, orientation)
    correction.evidence["map_frame_deg"] = scene.map_frame_deg
    correction.evidence["focal_length_sigma"] = scene.camera.focal_length_sigma
    correction.evidence["roll_by"] = by_others.to_dict() if by_others else None
    if by_others:
        correction.evidence["predicted_to_free"][ROLL] += by_others.roll_deg
    if not is_offset_from(predicted, pose, scene.camera):
        correction.evidence["predicted_to_free"] = None
    return correction


def as_correction(
    given: Problem,
    estimate: Estimate,
    start: State,
    away_px: float | None,
    led: Evidence | None = None,
    orientation: Orientation | None = None,
) -> Correction:
    """The estimate in the words that all steps share. led: what is said where the limb leads. orientation: what the
    markings say; where the body stays as predicted no turn is stated, but its prior's error."""
    scene, metadata, sigmas, limits = given.scene, given.metadata, given.sigmas, given.thresholds.pyramid
    step = difference(estimate.state, start, scene.camera)
    sigma = np.sqrt(np.maximum(np.diag(estimate.covariance), 0))
    free, held = estimate.free, estimate.free.held
    surplus = float(difference(estimate.free_state, metadata, scene.camera)[RANGE])
    free_sigma = float(np.sqrt(estimate.free_covariance[RANGE, RANGE]))
    radius = disk_radius_px(estimate.state.pose, scene.camera, scene.target)
    centre_sigma_px = float(np.sqrt(np.trace(estimate.free_covariance[OFFSET, OFFSET])))
    evidence: dict[str, Any] = {
        "iterations": len(free.history),
        "history": [taken.tolist() for taken in free.history],
        "unknowns": list(NAMES),
        "covariance": estimate.covariance.tolist(),
        "free_covariance": estimate.free_covariance.tolist(),
        "noise_covariance": estimate.noise.tolist(),
        "held": [name for name, is_held in zip(NAMES, held, strict=True) if is_held],
        "held_by_prior": [u.to_dict() for u in prior_dominated_directions(free.fit, estimate.shown, sigmas, held)],
        "range_psf_correlation": correlation(estimate.free_covariance, RANGE, PSF),
        "roll_attitude_correlation": [correlation(estimate.covariance, ROLL, axis) for axis in (4, 5, 6)],
        "turn_about_sight_assigned_to": "camera" if sigmas[ROLL] > sigmas[ATTITUDE.start] else "target",
        "range_factor_prior_sigma": float(sigmas[RANGE]) if np.isfinite(sigmas[RANGE]) else None,
        "second_start_px": away_px,
        "led_by_limb": led,
        "smear": smear_of(estimate.state),
        "bending": bending_evidence(estimate.bending),
        "detector": estimate.linearity.to_dict() if estimate.linearity else None,
        "displacement": estimate.displacement.to_dict() if estimate.displacement else None,
        "step": estimate.step.to_dict() if estimate.step else None,
        "predicted_to_free": difference(estimate.free_state, metadata, scene.camera).tolist(),
        "orientation": orientation.to_dict() if orientation else None,
    }
    if is_uniform(scene):
        evidence["attitude_held"] = "the base map is uniform: pointing, range and roll are from shape and shading alone"
    doubts = [
        doubt_of_convergence(free),
        None if held[RANGE] else doubt_of_range(surplus, free_sigma, float(sigmas[RANGE]), limits),
        doubt_of_markings(orientation) if orientation else None,
        # Where the limb leads, the markings are known to lie elsewhere, and a step of them says nothing of the picture.
        None if led else doubt_of_step(estimate.step, given.thresholds.contradiction),
        shape_doubt(given, estimate, orientation),
        (led or {}).get("doubt"),
        doubt_of_start(away_px, centre_sigma_px, free_sigma * radius, limits),
    ]
    if any(doubts):
        evidence["doubt"] = " ".join(doubt for doubt in doubts if doubt)
    changed = {
        "offset_px": step[OFFSET].tolist(),
        "range_factor": float(np.exp(step[RANGE])),
        "roll_deg": float(step[ROLL]),
        "attitude_deg": step[ATTITUDE].tolist(),
        "psf_sigma_px": estimate.state.psf_sigma_px,
        "range_factor_free": float(np.exp(surplus)),
    }
    uncertainty = {
        "offset_px": sigma[OFFSET].tolist(),
        "range_factor": float(sigma[RANGE]),
        "roll_deg": float(sigma[ROLL]),
        "attitude_deg": sigma[ATTITUDE].tolist(),
        "psf_sigma_px": float(sigma[PSF] * estimate.state.psf_sigma_px),
        "range_factor_free": free_sigma,
    }
    changed, uncertainty = without_held(changed, uncertainty, held)
    if orientation and orientation.kept == "prior" and sigma[ATTITUDE].all():
        changed["attitude_deg"], uncertainty["attitude_deg"] = None, sigma[ATTITUDE].tolist()
        by_prior = [{"direction": {name: 1.0}, "image_sigma_over_prior": None} for name in NAMES[ATTITUDE]]
        evidence["held_by_prior"] = [*evidence["held_by_prior"], *by_prior]
    return Correction("joint", estimate.state.pose, changed, uncertainty, evidence, free.converged)


def shape_doubt(given: Problem, estimate: Estimate, orientation: Orientation | None) -> str | None:
    """Whether the shape that is shown speaks against the target: that of the limb where markings, which relief
    displaces, tell the orientation; of limb and shading where none show that it is the body; and of both where optics
    do not bend so much. A target with a shape model is no ellipsoid anyway."""
    found, scene, limits = estimate.displacement, given.scene, given.thresholds
    if scene.target.shape is not None:
        return None
    radius = disk_radius_px(estimate.state.pose, scene.camera, scene.target)
    if doubt := doubt_of_displacement(found, given.settings.displaced_px, radius, limits.contradiction):
        return doubt
    if orientation is None:
        return None
    if orientation.markings.verdict == "matched":
        return doubt_of_relief(estimate.relief_px, radius, scene.target, limits.contradiction)
    if found is None:
        return None
    attitude_deg = min(float(np.max(given.sigmas[ATTITUDE])), UNKNOWN_DEG)
    return doubt_of_shape(found, estimate.state.pose, scene, attitude_deg, limits)


def smear_of(state: State) -> dict[str, float] | None:
    """Length (px) and direction (deg from +x towards +y, 0 to 180) of the exposure's smear; None without."""
    if not any(state.trail_px):
        return None
    x, y = state.trail_px
    return {"length_px": float(np.hypot(x, y)), "direction_deg": float(np.degrees(np.arctan2(y, x)) % 180)}


def bending_evidence(bending: Bending | None) -> Evidence | None:
    """What the disk shows of the beam's bending, in sigmas of what the marks say; None where it was left alone."""
    if bending is None or not bending.strength:
        return None
    return {"strength": bending.strength, "sigma": bending.sigma, "moved_px": bending.moved_px}


def without_held(changed: Evidence, uncertainty: Evidence, held: NDArray[np.bool_]) -> tuple[Evidence, Evidence]:
    """Both with None for what was held and so not determined; a held offset is none, a held factor one."""
    places = {
        "offset_px": OFFSET.start,
        "range_factor": RANGE,
        "range_factor_free": RANGE,
        "roll_deg": ROLL,
        "attitude_deg": ATTITUDE.start,
        "psf_sigma_px": PSF,
    }
    not_found = {key for key, place in places.items() if held[place]}
    kept = {"offset_px", "range_factor", "psf_sigma_px"}
    return (
        {key: None if key in not_found - kept else value for key, value in changed.items()},
        {key: None if key in not_found else value for key, value in uncertainty.items()},
    )


def correlation(matrix: Array, i: int, j: int) -> float:
    """Correlation coefficient of two unknowns; 0 when one is held."""
    scale = float(np.sqrt(matrix[i, i] * matrix[j, j]))
    return float(matrix[i, j]) / scale if scale > 0 else 0.0


def doubt_of_convergence(free: Solution) -> str | None:
    """Whether the iterations came to rest."""
    if free.converged:
        return None
    count = len(free.history)
    return f"{Reason.JOINT_NOT_SETTLED}: {count} iterations did not come to rest. Check picture and predicted pose."


def doubt_of_range(surplus: float, sigma: float, prior: float, limits: PyramidThresholds) -> str | None:
    """Whether the range that the image wants contradicts the trajectory."""
    allowed = limits.range_conflict_sigmas * float(np.hypot(sigma, prior))
    if abs(surplus) <= allowed:
        return None
    return (
        f"{Reason.RANGE_CONFLICT}: the image wants {np.exp(surplus):.5f} times the predicted range, the metadata allow "
        f"{prior:.1g} and the fit {sigma:.1g} (1 sigma). Check the target's radii and the source of the range."
    )


def doubt_of_start(
    away_px: float | None, centre_sigma_px: float, limb_sigma_px: float, limits: PyramidThresholds
) -> str | None:
    """Whether another start led elsewhere."""
    if away_px is None or away_px <= max(
        limits.disagreement_px, limits.starts_conflict_sigmas * float(np.hypot(centre_sigma_px, limb_sigma_px))
    ):
        return None
    return (
        f"{Reason.STARTS_DISAGREE}: from another start the solution lies {away_px:.2f} px away. Check the picture; "
        f"help with --start-offset or --hold."
    )
