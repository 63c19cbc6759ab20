"""Solve with the range free, judge it, and bring in what the trajectory knows of the range."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.errors import FailedError
from catalog.observation import Observation
from tasks.joint.bending import Bending, DistortionError, told_by_disk
from tasks.joint.blur import blurred_start
from tasks.joint.contradiction import chi_square, growth_of
from tasks.joint.displaced_markings import Displacement, displacement_shown
from tasks.joint.limb_response import limb_response
from tasks.joint.limb_seen import shown_by
from tasks.joint.linearity import Linearity, linearity_of
from tasks.joint.parameters import ATTITUDE, NAMES, OFFSET, PSF, RANGE, ROLL, State, difference
from tasks.joint.scale import Scale
from tasks.joint.settings import JointSettings, PriorSettings
from tasks.joint.solve import Solution, line_of, solve_joint
from tasks.joint.tiles import limb_gain
from tasks.joint.uncertainty import covariance, of_the_body, of_the_camera, systematic, times_usual
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
Progress = Callable[[str, int, str], None]
Source = Literal["spice", "label", "file", "image"]

# How far away the second start lies: pixels of the centre, of the limb, degrees.
SECOND_START = (1.2, -0.9, 0.8, 0.3)
# Sub-pixels per side while the solution is still on its way; then so many that the disk is this many across.
COARSE, FINE_ACROSS, FINEST = 2, 800.0, 8
EXACT = DistortionError()
# It only has to show where it leads: at half of the pixels where so many are left across, and in so many steps.
SECOND_DIAMETER_PX, SECOND_ITERATIONS = 140.0, 6
DISAGREEMENT_PX = 0.3
# A start that ends elsewhere, where the image fits worse by so many squares of sigmas, is caught in a false minimum.
SURELY_WORSE = 16.0


@dataclass(frozen=True)
class Estimate:
    """free: solution with the range free, at its own scale; shown: its covariance (8, 8) by its residuals. free_state,
    state: of the whole image, with the range free and with the trajectory's. free_covariance, covariance: (8, 8) of
    these, all errors included; common: (8, 8) the part that the limb's own edges share, by distortion and body.
    bending: what the disk told of it; the states are those of the image without it. None where none is known.
    linearity: what the disk told of the detector. displacement: what limb and markings told of a distortion; None where
    its error is known beforehand."""

    free: Solution
    shown: Array
    free_state: State
    state: State
    free_covariance: Array
    covariance: Array
    common: Array
    bending: Bending | None = None
    linearity: Linearity | None = None
    displacement: Displacement | None = None


def is_uniform(scene: Scene) -> bool:
    """Whether the base map has no markings, so that no turn of the target would show."""
    return bool(np.ptp(scene.basemap.albedo) == 0)


def without_markings(settings: JointSettings) -> JointSettings:
    """Settings for a target without a map: shape and shading alone, its attitude held."""
    return with_attitude_held(settings).model_copy(update={"plain": ()})


def with_attitude_held(settings: JointSettings) -> JointSettings:
    """Settings that leave the target's attitude as it is at the start."""
    held = settings.hold if "attitude" in settings.hold else (*settings.hold, "attitude")
    return settings.model_copy(update={"hold": held})


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
    """Solve with the range free, then weigh it against its prior."""
    free_range = sigmas.copy()
    free_range[RANGE] = np.inf
    first = Scale.of(observation, scene, start, settings.first_diameter_px)
    scale = Scale.of(observation, scene, start, settings.diameter_px)
    if first.n > scale.n:
        start = first.up(solved_at(first, start, metadata, coarse(settings), free_range, progress).state)
    near = solved_at(scale, start, metadata, coarse(settings), free_range, progress)
    # A vidicon's beam spreads light to one side; taken for a trail, it moves the range (Io by Voyager 1: by 0.08 %).
    blurred = blurred_start(near, settings.smear) if distortion.bending is None else None
    if blurred:
        near = solved_at(scale, scale.up(blurred), metadata, coarse(settings), free_range, progress)
    fine = settings.model_copy(update={"oversample": settings.oversample or fine_oversample(near.state, scale.scene)})
    free = solved_at(scale, scale.up(near.state), metadata, fine, free_range, progress, near)
    state = scale.up(free.state)
    radius = disk_radius_px(state.pose, scene.camera, scene.target)
    usual, blur = settings.systematic, state.width_px / scene.psf_sigma_px if scene.psf_sigma_px > 0 else 1.0
    larger = times_usual(usual, blur, limb_gain(free.fit, free.trust.tiles, free.model.tiles.sectors, settings.tiles))
    bending, of_bending = None, np.zeros((len(NAMES), len(NAMES)))
    if distortion.bending is not None:
        bending = told_by_disk(free, scale, distortion.bending, settings.bending_px)
        state = state.moved(-bending.strength * bending.response, scene.camera)
        of_bending = bending.sigma**2 * np.outer(bending.response, bending.response)
    shown = covariance(free.problem, free.fit)
    # Per pixel of the image, in its pixels.
    response = np.diag(scale.step_up(np.ones(len(NAMES)))) @ limb_response(free) / scale.n
    own = scale.covariance_up(shown) + systematic(usual, radius, larger=larger)
    common = of_bending + of_the_body(scene.target, radius, response, shape_shown_px(free, scale))
    common += of_the_camera(scene.camera)
    linearity = linearity_of(free)
    by_detector = scale.step_up(linearity.moved)
    common += np.outer(by_detector, by_detector)
    # Where a distortion model tells its own error, that is in the errors already.
    untold = distortion.bending is None and distortion.smooth_px == 0
    least_px = settings.displaced_px
    displacement = displacement_shown(free, least_px) if untold and least_px is not None else None
    if displacement:
        by_displacement = scale.step_up(displacement.moved)
        common += np.outer(by_displacement, by_displacement)
    common += systematic(usual, radius, distortion.smooth_px) - systematic(usual, radius)
    for errors in (own, common):
        errors[free.held, :] = errors[:, free.held] = 0
    errors = own + common
    estimate = Estimate(free, shown, state, state, errors, errors, common, bending, linearity, displacement)
    return weighed(estimate, metadata, sigmas, scene.camera)


def shape_shown_px(free: Solution, scale: Scale) -> float:
    """By how much, px RMS, whole arcs of the image's limb lie off the ellipsoid's; 0 where too little is measured."""
    try:
        return shown_by(free, scale, np.zeros(len(NAMES)))[0].coherent_px
    except FailedError:
        return 0.0


def weighed(estimate: Estimate, metadata: State, sigmas: Array, camera: Camera) -> Estimate:
    """The estimate with the free range weighed against its prior (one step of a Kalman filter).

    A free range that contradicts its prior speaks against the model: the product's errors are those of a covariance
    that is grown until it does not. The free solution's own stay, so that the contradiction can be told."""
    state, errors, prior = estimate.free_state, estimate.free_covariance, sigmas[RANGE]
    if estimate.free.held[RANGE] or not np.isfinite(prior):
        return replace(estimate, state=state, covariance=errors)
    surplus = difference(state, metadata, camera)[RANGE]
    others = estimate.common[RANGE, RANGE] + prior**2
    if surplus**2 > chi_square(1) * (errors[RANGE, RANGE] + prior**2):
        own = errors - estimate.common
        grown = growth_of(own[RANGE : RANGE + 1, RANGE : RANGE + 1], np.array([[others]]), np.array([surplus]))
        errors = grown * own + estimate.common
    gain = errors[:, RANGE] / (errors[RANGE, RANGE] + prior**2)
    product = state.moved(-gain * surplus, camera)
    return replace(estimate, state=product, covariance=errors - np.outer(gain, errors[RANGE]))


def solved_at(
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
    """Sub-pixels per side that keep the sampling from moving the solution by more than 0.01 px (measured)."""
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
    rest, or fits surely worse than the solution does: markings may catch it."""
    x_px, y_px, limb_px, turn_deg = SECOND_START
    radius = disk_radius_px(start.pose, scene.camera, scene.target)
    step = np.zeros(len(NAMES))
    step[OFFSET], step[RANGE], step[ATTITUDE] = (x_px, y_px), limb_px / radius, turn_deg
    step[estimate.free.held] = 0
    free_range = sigmas.copy()
    free_range[RANGE] = np.inf
    across = min(settings.first_diameter_px, max(SECOND_DIAMETER_PX, radius))
    scale = Scale.of(observation, scene, start, across)
    quick = coarse(settings).model_copy(update={"max_iterations": SECOND_ITERATIONS})
    # The PSF is no question of where the target is: it is the one that was found.
    found_psf = replace(start, psf_sigma_px=estimate.state.psf_sigma_px, trail_px=estimate.state.trail_px)
    other = solved_at(scale, found_psf.moved(step, scene.camera), metadata, quick, free_range)
    if scale.n * np.hypot(*other.left[OFFSET]) + abs(other.left[RANGE]) * radius > DISAGREEMENT_PX / 2:
        return None
    found = scale.up(other.state)
    place = estimate.free_state
    if estimate.bending:
        place = place.moved(estimate.bending.strength * estimate.bending.response, scene.camera)
    apart = difference(found, place, scene.camera)
    away = float(np.hypot(np.hypot(*apart[OFFSET]), apart[RANGE] * radius))
    if away > DISAGREEMENT_PX:
        line = line_of(other, scale.observation, scale.down(metadata), scale.scene, quick, free_range)
        if line.cost_at(other, scale.down(place)) + SURELY_WORSE < line.cost_at(other, other.state):
            return None
    return away
