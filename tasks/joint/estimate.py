"""The joint step: solve with the range free, judge it, and bring in what the trajectory knows of the range."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.correction import Correction
from tasks.joint.parameters import ATTITUDE, NAMES, OFFSET, PSF, RANGE, ROLL, State, difference
from tasks.joint.scale import Scale
from tasks.joint.settings import JointSettings, PriorSettings
from tasks.joint.solve import Solution, solve_joint
from tasks.joint.uncertainty import DistortionError, bent, covariance, of_the_body, systematic, untold_directions
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
Progress = Callable[[str, int, str], None]
Told = dict[str, Any]
Source = Literal["spice", "label", "file"]

# How far away the second start lies: pixels of the centre, of the limb, degrees.
SECOND_START = (1.2, -0.9, 0.8, 0.3)
# Sub-pixels per side while the solution is still on its way; then so many that the disk is this many across.
COARSE, FINE_ACROSS, FINEST = 2, 900.0, 8
CONFLICT_SIGMAS = 5.0
EXACT = DistortionError()
DISAGREEMENT_PX = 0.3


@dataclass(frozen=True)
class Estimate:
    """free: solution with the range free, at its own scale; shown: its covariance (8, 8) by its residuals. free_state,
    state: of the whole image, with the range free and with the trajectory's. free_covariance, covariance: (8, 8) of
    these, all errors included."""

    free: Solution
    shown: Array
    free_state: State
    state: State
    free_covariance: Array
    covariance: Array


def find_pose_jointly(
    observation: Observation,
    pose: Pose,
    predicted: Pose,
    source: Source,
    scene: Scene,
    settings: JointSettings,
    progress: Progress | None = None,
    distortion: DistortionError = EXACT,
) -> Correction:
    """Correct pointing, range, roll and attitude together, with PSF width and photometry solved along.

    pose: where to start. predicted: what the metadata say, from `source`; the priors are about it. changed and
    uncertainty: as of the other steps, relative to `pose`, and `psf_sigma_px`, `range_factor_free` (relative to
    `predicted`); None for what was held. A target without a map keeps its attitude. Raises FailedError when too few
    pixels are usable.
    """
    priors: PriorSettings = getattr(settings.priors, source)
    metadata, start = (State(p, scene.psf_sigma_px) for p in (predicted, pose))
    if is_uniform(scene):
        settings = without_markings(settings)
    sigmas = prior_sigmas(priors)
    estimate = estimated(observation, start, metadata, sigmas, scene, settings, progress, distortion)
    away = (
        second_start(observation, start, metadata, sigmas, estimate, scene, settings) if settings.second_start else None
    )
    return as_correction(estimate, start, metadata, sigmas, away, scene)


def is_uniform(scene: Scene) -> bool:
    """Whether the base map has no markings, so that no turn of the target would show."""
    return bool(np.ptp(scene.basemap.albedo) == 0)


def without_markings(settings: JointSettings) -> JointSettings:
    """Settings for a target without a map: shape and shading alone, its attitude held."""
    return settings.model_copy(update={"plain": (), "hold": tuple({*settings.hold, "attitude"})})


def prior_sigmas(priors: PriorSettings) -> Array:
    """1-sigma (8,) of the priors in the unknowns' order; inf where free."""
    sigmas = np.full(len(NAMES), np.inf)
    for places, sigma in (
        (RANGE, priors.range_relative),
        (ROLL, priors.roll_deg),
        (ATTITUDE, priors.attitude_deg),
        (PSF, priors.psf_relative),
    ):
        sigmas[places] = np.inf if sigma is None else sigma
    return sigmas


def estimated(
    observation: Observation,
    start: State,
    metadata: State,
    sigmas: Array,
    scene: Scene,
    settings: JointSettings,
    progress: Progress | None = None,
    distortion: DistortionError = EXACT,
) -> Estimate:
    """Solve with the range free, then weigh it against its prior (one step of a Kalman filter)."""
    free_range = sigmas.copy()
    free_range[RANGE] = np.inf
    first = Scale.of(observation, scene, start, settings.first_diameter_px)
    scale = Scale.of(observation, scene, start, settings.diameter_px)
    if first.n > scale.n:
        start = first.up(_solved(first, start, metadata, coarse(settings), free_range, progress).state)
    near = _solved(scale, start, metadata, coarse(settings), free_range, progress)
    fine = settings.model_copy(update={"oversample": settings.oversample or fine_oversample(near.state, scale.scene)})
    free = _solved(scale, scale.up(near.state), metadata, fine, free_range, progress, near)
    state = scale.up(free.state)
    radius = disk_radius_px(state.pose, scene.camera, scene.target)
    bending = None if distortion.bending is None else scale.planes_down(distortion.bending)
    shown = covariance(free.problem, free.fit)
    errors = scale.covariance_up(shown + bent(free, bending))
    errors += systematic(settings.systematic, radius, distortion.smooth_px) + of_the_body(scene.target, radius)
    errors[free.held, :] = errors[:, free.held] = 0
    prior = sigmas[RANGE]
    if free.held[RANGE] or not np.isfinite(prior):
        return Estimate(free, shown, state, state, errors, errors)
    gain = errors[:, RANGE] / (errors[RANGE, RANGE] + prior**2)
    surplus = difference(state, metadata, scene.camera)[RANGE]
    product = state.moved(-gain * surplus, scene.camera)
    return Estimate(free, shown, state, product, errors, errors - np.outer(gain, errors[RANGE]))


def _solved(
    scale: Scale,
    start: State,
    metadata: State,
    settings: JointSettings,
    sigmas: Array,
    progress: Progress | None = None,
    warm: Solution | None = None,
) -> Solution:
    """`solve_joint` at a scale, from states of the whole image; its result is the scale's."""
    return solve_joint(
        scale.observation,
        scale.down(start),
        scale.down(metadata),
        scale.scene,
        settings,
        sigmas,
        progress,
        warm,
    )


def coarse(settings: JointSettings) -> JointSettings:
    """The same at few sub-pixels."""
    return settings.model_copy(update={"oversample": min(settings.oversample or COARSE, COARSE)})


def fine_oversample(state: State, scene: Scene) -> int:
    """Sub-pixels per side that keep the sampling of limb and markings from moving the solution (measured: 0.001 px)."""
    across = 2 * disk_radius_px(state.pose, scene.camera, scene.target)
    return int(np.clip(np.ceil(FINE_ACROSS / max(across, 1.0)), COARSE, FINEST))


def second_start(
    observation: Observation,
    start: State,
    metadata: State,
    sigmas: Array,
    estimate: Estimate,
    scene: Scene,
    settings: JointSettings,
) -> float | None:
    """Pixels between the limbs of the solution and of a quick one that began elsewhere; None when that did not come to
    rest."""
    x_px, y_px, limb_px, turn_deg = SECOND_START
    radius = disk_radius_px(start.pose, scene.camera, scene.target)
    step = np.zeros(len(NAMES))
    step[OFFSET], step[RANGE], step[ATTITUDE] = (x_px, y_px), limb_px / radius, turn_deg
    step[estimate.free.held] = 0
    free_range = sigmas.copy()
    free_range[RANGE] = np.inf
    scale = Scale.of(observation, scene, start, settings.first_diameter_px)
    other = _solved(scale, start.moved(step, scene.camera), metadata, coarse(settings), free_range)
    if not other.converged or scale.n * np.hypot(*other.left[OFFSET]) > DISAGREEMENT_PX / 2:
        return None
    apart = difference(scale.up(other.state), estimate.free_state, scene.camera)
    return float(np.hypot(np.hypot(*apart[OFFSET]), apart[RANGE] * radius))


def as_correction(
    estimate: Estimate,
    start: State,
    metadata: State,
    sigmas: Array,
    away_px: float | None,
    scene: Scene,
) -> Correction:
    """The estimate in the words that all steps share."""
    step = difference(estimate.state, start, scene.camera)
    sigma = np.sqrt(np.maximum(np.diag(estimate.covariance), 0))
    free, held = estimate.free, estimate.free.held
    surplus = float(difference(estimate.free_state, metadata, scene.camera)[RANGE])
    free_sigma = float(np.sqrt(estimate.free_covariance[RANGE, RANGE]))
    radius = disk_radius_px(estimate.state.pose, scene.camera, scene.target)
    evidence: dict[str, Any] = {
        "iterations": len(free.history),
        "history": [taken.tolist() for taken in free.history],
        "unknowns": list(NAMES),
        "covariance": estimate.covariance.tolist(),
        "held": [name for name, is_held in zip(NAMES, held, strict=True) if is_held],
        "held_by_prior": [u.to_dict() for u in untold_directions(free.fit, estimate.shown, sigmas, held)],
        "range_psf_correlation": correlation(estimate.free_covariance, RANGE, PSF),
        "roll_attitude_correlation": [correlation(estimate.covariance, ROLL, axis) for axis in (4, 5, 6)],
        "turn_about_sight_assigned_to": "camera" if sigmas[ROLL] > sigmas[ATTITUDE.start] else "target",
        "range_factor_prior_sigma": float(sigmas[RANGE]) if np.isfinite(sigmas[RANGE]) else None,
        "second_start_px": away_px,
        "predicted_to_free": difference(estimate.free_state, metadata, scene.camera).tolist(),
    }
    if is_uniform(scene):
        evidence["attitude_held"] = "the base map is uniform: pointing, range and roll are from shape and shading alone"
    doubts = [
        doubt_of_convergence(free),
        doubt_of_range(surplus, free_sigma, float(sigmas[RANGE]), bool(held[RANGE])),
        doubt_of_start(away_px, np.sqrt(np.trace(estimate.free_covariance[OFFSET, OFFSET])), free_sigma * radius),
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
    return Correction("joint", estimate.state.pose, *without_held(changed, uncertainty, held), evidence, free.converged)


def without_held(changed: Told, uncertainty: Told, held: NDArray[np.bool_]) -> tuple[Told, Told]:
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
    return f"joint-not-settled: {len(free.history)} iterations did not come to rest. Check picture and predicted pose."


def doubt_of_range(surplus: float, sigma: float, prior: float, held: bool) -> str | None:
    """Whether the range that the image wants contradicts the trajectory."""
    allowed = CONFLICT_SIGMAS * float(np.hypot(sigma, prior))
    if held or abs(surplus) <= allowed:
        return None
    return (
        f"range-conflict: the image wants {np.exp(surplus):.5f} times the predicted range, the metadata allow "
        f"{prior:.1g} and the fit {sigma:.1g} (1 sigma). Check the target's radii and the source of the range."
    )


def doubt_of_start(away_px: float | None, centre_sigma_px: float, limb_sigma_px: float) -> str | None:
    """Whether another start led elsewhere."""
    if away_px is None or away_px <= max(
        DISAGREEMENT_PX, CONFLICT_SIGMAS * float(np.hypot(centre_sigma_px, limb_sigma_px))
    ):
        return None
    return (
        f"starts-disagree: from another start the solution lies {away_px:.2f} px away. Check the picture; "
        f"help with --start-offset or --hold."
    )
