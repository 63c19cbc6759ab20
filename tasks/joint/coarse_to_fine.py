"""Coarse to fine: solve with the range free, at ever more pixels and sub-pixels, find the errors, and bring in what the
trajectory knows of the range."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from tasks.joint.beam_bending import Bending, bending_shown
from tasks.joint.blur import blurred_start
from tasks.joint.contradiction import chi_square, growth_of
from tasks.joint.displaced_markings import Displacement, displacement_shown
from tasks.joint.gauss_newton import Line, Solution, solve_joint
from tasks.joint.limb_observation import LimbObservation, shown_by
from tasks.joint.linearity import Linearity, displaced_by_levels, linearity_of
from tasks.joint.parameters import ATTITUDE, NAMES, OFFSET, PSF, RANGE, ROLL, State, difference, with_psf_within
from tasks.joint.problem import Problem
from tasks.joint.pyramid import Level
from tasks.joint.relief_response import relief_response
from tasks.joint.thresholds import PyramidThresholds
from tasks.joint.tile_prior import limb_gain
from tasks.joint.uncertainty import covariance, noise_covariance, of_the_body, of_the_camera, systematic, times_usual
from tasks.priors import PriorSettings
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
Source = Literal["spice", "label", "file", "image"]


@dataclass(frozen=True)
class Estimate:
    """free: solution with the range free, at its own scale; shown: its covariance (8, 8) by its residuals. free_state,
    state: of the whole image, with the range free and with the trajectory's. free_covariance, covariance: (8, 8) of
    these, all errors included; common: (8, 8) the part that the limb's own edges share, by distortion and body;
    noise: (8, 8) the part of the pixels' noise, which another exposure draws anew.
    bending: what the disk shows of it; the states are those of the image without it. None where none is known.
    linearity: what the disk shows of the detector. displacement: what limb and markings show of a distortion; None
    where its error is known beforehand. relief_px: by how much arcs of the limb lie off as a whole, see
    `coherent_px`."""

    free: Solution
    shown: Array
    free_state: State
    state: State
    free_covariance: Array
    covariance: Array
    common: Array
    noise: Array
    bending: Bending | None = None
    linearity: Linearity | None = None
    displacement: Displacement | None = None
    relief_px: float = 0.0


def is_uniform(scene: Scene) -> bool:
    """Whether the base map has no markings, so that no turn of the target would show."""
    return bool(np.ptp(scene.basemap.albedo) == 0)


def without_markings(given: Problem) -> Problem:
    """The problem of a target without a map: shape and shading alone, its attitude held."""
    return given.with_attitude_held().with_settings(plain=())


def prior_sigmas(priors: PriorSettings, range_km: float) -> Array:
    """1-sigma (8,) of the priors in the unknowns' order, at a predicted range; inf where free."""
    sigmas = np.full(len(NAMES), np.inf)
    for places, sigma in (
        (RANGE, priors.range_sigma(range_km)),
        (ROLL, priors.roll_deg),
        (ATTITUDE, priors.attitude_deg),
        (PSF, priors.psf_relative),
    ):
        sigmas[places] = np.inf if sigma is None else sigma
    return sigmas


def estimated(given: Problem, start: State) -> Estimate:
    """Solve with the range free, then weigh it against its prior."""
    settings, scene, distortion = given.settings, given.scene, given.distortion
    free_range = given.with_free_range()
    free, level = solved_free(free_range, start)
    state = level.up(free.state)
    radius = disk_radius_px(state.pose, scene.camera, scene.target)
    usual, blur = settings.systematic, state.width_px / scene.psf_sigma_px if scene.psf_sigma_px > 0 else 1.0
    gain = limb_gain(free.fit, free.variances.tiles, free.model.tiles.sectors, settings.tiles)
    larger = times_usual(usual, blur, gain)
    bending, of_bending = None, np.zeros((len(NAMES), len(NAMES)))
    if distortion.bending is not None:
        bending = bending_shown(free, level, distortion.bending, settings.bending_px)
        state = state.moved(-bending.strength * bending.response, scene.camera)
        of_bending = bending.sigma**2 * np.outer(bending.response, bending.response)
    shown = covariance(free.problem, free.fit)
    # Per pixel of the image, in its pixels.
    response = np.diag(level.step_up(np.ones(len(NAMES)))) @ relief_response(free) / level.n
    data = free.data
    read = float(np.sqrt(np.median(data.variance[data.usable])))
    levels_px = level.n * displaced_by_levels(data.image[data.usable], read, data.bright, free.state.width_px)
    own = level.covariance_up(shown) + systematic(usual, radius, levels_px=levels_px, larger=larger)
    own[ATTITUDE, ATTITUDE] += scene.map_frame_deg**2 * np.eye(3)
    limb = limb_seen(free, level)
    relief_px = limb.coherent_px if limb else 0.0
    common = of_bending + of_the_body(scene.target, radius, response, relief_px)
    common += of_the_camera(scene.camera)
    linearity = linearity_of(free)
    by_detector = level.step_up(linearity.moved)
    common += np.outer(by_detector, by_detector)
    # Where a distortion model states its own error, that is in the errors already.
    unmodelled = distortion.bending is None and distortion.smooth_px == 0
    expected_px = settings.displaced_px
    displacement = displacement_shown(free, level, expected_px) if unmodelled and expected_px is not None else None
    if displacement and limb:
        displacement = displacement.at_most(limb.largest_term_px)
    if displacement:
        common += displacement.covariance
    common += systematic(usual, radius, distortion.smooth_px) - systematic(usual, radius)
    for errors in (own, common):
        errors[free.held, :] = errors[:, free.held] = 0
    errors = own + common
    noise = level.covariance_up(noise_covariance(free.problem, free.fit, np.asarray(free.data.variance, np.float64)))
    found = (noise, bending, linearity, displacement, relief_px)
    return with_range_prior(Estimate(free, shown, state, state, errors, errors, common, *found), given)


def solved_free(given: Problem, start: State) -> tuple[Solution, Level]:
    """The solution at ever more pixels and sub-pixels, and the level that it is at."""
    settings, finely = given.settings, given.thresholds.pyramid
    quick = coarse(given)
    first = Level.of(given, start, settings.first_diameter_px)
    level = Level.of(given, start, settings.diameter_px)
    if first.n > level.n:
        start = first.up(solved_at(first, quick, start, on_the_way=True).state)
    # Where as few sub-pixels are enough this is the solution itself.
    on_the_way = (settings.oversample or fine_oversample(start, level.scene, finely)) != quick.settings.oversample
    near = solved_at(level, quick, start, on_the_way=on_the_way)
    # A vidicon's beam spreads light to one side; taken for a trail, it moves the range (Io by Voyager 1: by 0.08 %).
    blurred = blurred_start(near, settings.smear) if given.distortion.bending is None else None
    if blurred:
        near = solved_at(level, quick, level.up(blurred), on_the_way=on_the_way)
    oversample = settings.oversample or fine_oversample(near.state, level.scene, finely)
    if oversample == near.model.oversample and near.converged and not on_the_way:
        return replace(near, given=level.problem(given)), level
    return solved_at(level, given.with_settings(oversample=oversample), level.up(near.state), near), level


def limb_seen(free: Solution, level: Level) -> LimbObservation | None:
    """What the image's limb shows from the free solution; None where too little is measured."""
    try:
        return shown_by(free, level, np.zeros(len(NAMES)))[0]
    except FailedError:
        return None


def with_range_prior(estimate: Estimate, given: Problem) -> Estimate:
    """The estimate with the free range weighed against its prior (one step of a Kalman filter).

    A free range that contradicts its prior speaks against the model: the product's errors are those of a covariance
    that is grown until it does not. The free solution's own stay, so that the contradiction can be seen."""
    state, errors, prior = estimate.free_state, estimate.free_covariance, given.sigmas[RANGE]
    if estimate.free.held[RANGE] or not np.isfinite(prior):
        return replace(estimate, state=state, covariance=errors)
    camera, chance = given.scene.camera, given.thresholds.contradiction.chance_range
    surplus = difference(state, given.metadata, camera)[RANGE]
    others = estimate.common[RANGE, RANGE] + prior**2
    if surplus**2 > chi_square(1, chance) * (errors[RANGE, RANGE] + prior**2):
        own = errors - estimate.common
        grown = growth_of(own[RANGE : RANGE + 1, RANGE : RANGE + 1], np.array([[others]]), np.array([surplus]))
        errors = grown * own + estimate.common
    gain = errors[:, RANGE] / (errors[RANGE, RANGE] + prior**2)
    product = state.moved(with_psf_within(-gain * surplus, given.thresholds.iteration.largest_psf), camera)
    return replace(estimate, state=product, covariance=errors - np.outer(gain, errors[RANGE]))


def solved_at(
    level: Level, given: Problem, start: State, warm: Solution | None = None, on_the_way: bool = False
) -> Solution:
    """`solve_joint` at a level, from a state of the whole image; its result is the level's."""
    return solve_joint(level.problem(given), level.down(start), warm, on_the_way)


def coarse(given: Problem) -> Problem:
    """The same at few sub-pixels."""
    few = given.thresholds.pyramid.coarse_oversample
    return given.with_settings(oversample=min(given.settings.oversample or few, few))


def fine_oversample(state: State, scene: Scene, finely: PyramidThresholds) -> int:
    """Sub-pixels per side that keep the sampling from moving the solution."""
    across = 2 * disk_radius_px(state.pose, scene.camera, scene.target)
    wanted = np.ceil(finely.fine_across / max(across, 1.0))
    return int(np.clip(wanted, finely.coarse_oversample, finely.finest_oversample))


def second_start(given: Problem, start: State, estimate: Estimate) -> float | None:
    """Pixels between the limbs of the solution and of a quick one that began elsewhere; None when that did not come to
    rest, or fits surely worse than the solution does: markings may catch it."""
    camera, limits = given.scene.camera, given.thresholds.pyramid
    radius = disk_radius_px(start.pose, camera, given.scene.target)
    step = np.zeros(len(NAMES))
    step[OFFSET], step[RANGE] = limits.second_offset_px, limits.second_limb_px / radius
    step[ATTITUDE] = limits.second_turn_deg
    step[estimate.free.held] = 0
    across = min(given.settings.first_diameter_px, max(limits.second_diameter_px, radius))
    level = Level.of(given, start, across)
    quick = coarse(given).with_free_range().with_settings(max_iterations=limits.second_iterations)
    # The PSF is no question of where the target is: it is the one that was found.
    found_psf = replace(start, psf_sigma_px=estimate.state.psf_sigma_px, trail_px=estimate.state.trail_px)
    other = solved_at(level, quick, found_psf.moved(step, camera), on_the_way=True)
    if level.n * np.hypot(*other.left[OFFSET]) + abs(other.left[RANGE]) * radius > limits.disagreement_px / 2:
        return None
    found = level.up(other.state)
    place = estimate.free_state
    if estimate.bending:
        place = place.moved(estimate.bending.strength * estimate.bending.response, camera)
    apart = difference(found, place, camera)
    away = float(np.hypot(np.hypot(*apart[OFFSET]), apart[RANGE] * radius))
    if away > limits.disagreement_px:
        line = Line.of(other, level.problem(quick))
        if line.cost_at(other, level.down(place)) + limits.surely_worse < line.cost_at(other, other.state):
            return None
    return away
