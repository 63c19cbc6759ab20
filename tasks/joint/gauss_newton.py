"""Gauss-Newton: one step after the other from a linearised problem, the geometry rendered anew at each."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.reasons import Reason
from tasks.compare.match import framed_window
from tasks.compare.occulted import light_behind
from tasks.joint.cutout import Cutout
from tasks.joint.model import Model, linear_model
from tasks.joint.normal_equations import Fit, LinearProblem, solve_linear
from tasks.joint.parameters import ATTITUDE, NAMES, OFFSET, PSF, RANGE, ROLL, State, difference
from tasks.joint.problem import Problem
from tasks.joint.settings import JointSettings
from tasks.joint.thresholds import IterationThresholds
from tasks.joint.tiles import LOCAL, Layout, Tiles, layout_for, tiles_of
from tasks.joint.variance_model import VarianceModel
from tasks.simulate import Scene
from tasks.simulate.window import Window, disk_radius_px

Array = NDArray[np.float64]
Image = NDArray[np.float32]

# Shares of a step that are tried, one after the other, until the cost falls. Where none lowers it the state is a
# minimum as far as the sampling shows, unless the last of them is larger than error and a step that is not taken.
SHARES = (1.0, 0.3, 0.1, 0.03)
# Inverse variance of what is held.
FIXED = 1e30


@dataclass(frozen=True)
class Solution:
    """given: the problem, at the resolution of the solution. state: where the iterations ended, the last small step
    taken; fit: the last linear problem, its last eight columns the unknowns of `parameters.NAMES`, and its problem;
    model: what it was linearised on, before that step; data: the pixels; left: the step (8,) that was not taken any
    more; lessons: how often the variances were learned."""

    given: Problem
    state: State
    fit: Fit
    problem: LinearProblem
    model: Model
    data: Cutout
    held: NDArray[np.bool_]
    history: list[Array]
    left: Array
    converged: bool
    variances: VarianceModel
    lessons: int


def solve_joint(given: Problem, start: State, warm: Solution | None = None, on_the_way: bool = False) -> Solution:
    """Gauss-Newton from `start`, the geometry rendered anew at each step.

    warm: an earlier solution, of other sampling for instance, whose tiles and variances are taken over. on_the_way:
    another solution follows, or only the place is wanted.
    Raises FailedError when too few pixels are usable or the disk leaves the frame.
    """
    scene, settings, limits, held = given.scene, given.settings, given.thresholds.iteration, given.held
    window = framed_window(scene, start.pose)
    data = data_at(given, start, window)
    radius = disk_radius_px(start.pose, scene.camera, scene.target)
    layout = warm.model.tiles.layout if warm else layout_for(radius, settings.tiles)
    model = linear_model(given, start, window, tiles_at(start, scene, window, layout), data.light_behind)
    variances = warm.variances if warm else VarianceModel.at_first(model, settings)
    weights = first_weights(model, data, settings)
    linear = solve_linear(
        brightness_problem(model, data, weights, variances.tiles, settings),
        variances.weight(model, data, weights, settings),
    )
    weights = linear.values[: len(model.bases)]
    history: list[Array] = []
    taken, lessons = np.zeros(len(NAMES)), warm.lessons if warm else 0
    while True:
        line = Line(given, data, variances.weight(model, data, weights, settings), variances.tiles)
        problem, trails = line.linearised(model, weights, linear)
        fit = solve_linear(problem, line.weight, linear.residual)
        full = fit.values[-len(NAMES) :] * ~held
        lengthening = fit.values[len(fit.values) - len(NAMES) - trails : -len(NAMES)]
        share = bearable(full, lengthening, limits, disk_radius_px(model.state.pose, scene.camera, scene.target))
        step, lengthened = share * full, share * lengthening
        every = np.sqrt(np.diag(fit.covariance))
        error, of_trail = every[-len(NAMES) :], every[len(every) - len(NAMES) - trails : -len(NAMES)]
        if given.progress:
            given.progress("joint", len(history) + 1, step_text(step))
        near = limits.on_the_way if on_the_way else limits.at_rest
        converged = bool((np.abs(step) < np.maximum(near * error, still(limits))).all())
        converged = converged and bool((np.abs(lengthened) < np.maximum(near * of_trail, limits.still_trail_px)).all())
        if converged and lessons < limits.lessons and not on_the_way:
            # The errors of what is at rest at once are not known yet.
            variances, lessons = variances.learned(model, data, weights, linear, settings), lessons + 1
            continue
        if converged:
            end, left = model.state.moved(step, scene.camera).trailed(lengthened), np.zeros(len(NAMES))
            history.append(step)
            break
        end, left = model.state, step
        if len(history) == settings.max_iterations:
            break
        unit = np.where(error > 0, error, np.inf)
        ahead = aitken(step / unit, taken / unit, limits)
        found = line.lower(model, ahead * step, lengthened, fit) if ahead > 1 else None
        found = found or line.lower(model, step, lengthened, fit)
        if found is None:
            converged = bool((SHARES[-1] * np.abs(step) < np.maximum(error, still(limits))).all())
            break
        model, linear, taken = found
        weights = linear.values[: len(model.bases)]
        history.append(taken)
        if len(history) <= limits.learning:
            variances, lessons = variances.learned(model, data, weights, linear, settings), lessons + 1
        fresh = tiles_at(model.state, scene, window, layout)
        if fresh.away_px(model.tiles) > limits.stale_px:
            model = replace(model, tiles=fresh)
    return Solution(given, end, fit, problem, model, data, held, history, left, converged, variances, lessons)


def aitken(step: Array, before: Array, limits: IterationThresholds) -> float:
    """How many times as far the rest of the way is as a step (n,), in units of its errors, where steps shrink evenly
    along one direction, as the linearisation has them too short; 1 where they do not (Aitken 1926, Proc. R. Soc. Edinb.
    46, 289: the limit of a series of constant ratio)."""
    square, along = float(before @ before), float(step @ before)
    if square == 0 or along < limits.least_parallel * np.sqrt(square * float(step @ step)):
        return 1.0
    ratio = along / square
    return 1 / (1 - ratio) if limits.least_even < ratio < limits.most_even else 1.0


def still(limits: IterationThresholds) -> Array:
    """Steps (8,) of the unknowns that need not be taken."""
    return np.array([limits.still_px] * 2 + [limits.still_range] + [limits.still_deg] * 4 + [limits.still_psf])


def data_at(given: Problem, state: State, window: Window) -> Cutout:
    """The pixels under a window, and what the target hides of a body behind it."""
    return Cutout(given.observation, window, light_behind(given.observation, state.pose, given.scene, window))


def tiles_at(state: State, scene: Scene, window: Window, layout: Layout) -> Tiles:
    """Tiles about the disk at `state`."""
    centre = scene.camera.project(state.pose.target_in_camera_km) - (window.x0, window.y0)
    return tiles_of(window.shape, centre, disk_radius_px(state.pose, scene.camera, scene.target), layout)


def brightness_problem(
    model: Model, data: Cutout, weights: Array, local_prior: Array, settings: JointSettings
) -> LinearProblem:
    """The problem of the linear unknowns alone: weights of laws and wings, light hidden, background, tiles."""
    bright = model.brightness(weights)
    columns = model.columns(weights, bright)
    prior = np.zeros(len(columns))
    laws = len(model.bases)
    prior[:laws] = (settings.law_weight * data.bright) ** -2
    prior[laws : laws + len(settings.wings_px)] = settings.wings_sigma**-2
    if model.by_sun:
        prior[-len(model.by_sun) :] = model.sun_deg**-2
    expected = np.zeros_like(prior)
    if model.hides:
        share, sigma = data.hidden_share
        prior[laws - 1], expected[laws - 1] = 1 / (settings.hidden_sigma**2 + sigma**2), share
    local, limits = model.local(bright), settings.thresholds
    return LinearProblem(data.image, columns, local, model.tiles, prior, expected, local_prior, settings.huber, limits)


@dataclass(frozen=True)
class Line:
    """What one step is taken with, everything but the state kept: pixels, their weight (ny, nx), and the inverse
    variances (tiles, LOCAL) of the tiles' unknowns."""

    given: Problem
    data: Cutout
    weight: Image
    local_prior: Array

    @classmethod
    def of(cls, solution: Solution, given: Problem) -> "Line":
        """What the last step of `solution` was taken with, to compare other states of `given`, which differs at most in
        metadata, priors and settings."""
        data = replace(solution.data, observation=given.observation)
        weights = solution.fit.values[: len(solution.model.bases)]
        weight = solution.variances.weight(solution.model, data, weights, given.settings)
        return cls(given, data, weight, solution.variances.tiles)

    def linearised(self, model: Model, weights: Array, linear: Fit) -> tuple[LinearProblem, int]:
        """The linear problem of all unknowns at the state of `model`, and how many of its columns are the trail's.

        image = brightness + trail's columns . lengthening + derivatives . step; the priors are about the metadata, as
        far away as they are from the state.
        """
        given = self.given
        moving = model.derivatives(weights, linear.gain)
        moving[given.held] = 0
        trail = model.trail_columns(weights, linear.gain)
        none, done = np.zeros(len(trail)), difference(model.state, given.metadata, given.scene.camera)
        prior = np.where(given.held, FIXED, 1 / given.sigmas**2)
        expected = np.where(given.held | ~np.isfinite(given.sigmas), 0, -done)
        brightness = brightness_problem(model, self.data, weights, self.local_prior, given.settings)
        problem = replace(
            brightness,
            columns=np.concatenate([brightness.columns, trail, moving]),
            prior=np.concatenate([brightness.prior, none, prior]),
            expected=np.concatenate([brightness.expected, none, expected]),
        )
        return problem, len(trail)

    def lower(self, model: Model, step: Array, lengthened: Array, fit: Fit) -> tuple[Model, Fit, Array] | None:
        """The first of ever shorter steps that lowers the cost: model and linear fit there, and the step taken."""
        weights = fit.values[: len(model.bases)]
        before, _ = self.cost(model, weights, fit)
        error = np.sqrt(np.diag(fit.covariance)[-len(NAMES) :])
        for share in SHARES if (np.abs(step) > error).any() else SHARES[:2]:
            state = model.state.moved(share * step, self.given.scene.camera).trailed(share * lengthened)
            moved = self.model_at(state, model)
            after, linear = self.cost(moved, weights, fit)
            if after < before:
                return moved, linear, share * step
        return None

    def model_at(self, state: State, model: Model) -> Model:
        """The model at another state, under the same window and tiles."""
        return linear_model(self.given, state, model.window, model.tiles, self.data.light_behind)

    def cost(self, model: Model, weights: Array, fit: Fit) -> tuple[float, Fit]:
        """Cost of the state of `model` with the best linear unknowns, and their fit."""
        given = self.given
        problem = brightness_problem(model, self.data, weights, self.local_prior, given.settings)
        linear = solve_linear(problem, self.weight, fit.residual)
        away = difference(model.state, given.metadata, given.scene.camera)
        away[given.held] = 0
        return linear.cost + float(np.sum((away / given.sigmas) ** 2)), linear

    def cost_at(self, solution: Solution, state: State) -> float:
        """Cost of another state than the solution's, everything else kept and the linear unknowns solved anew."""
        model = self.model_at(state, solution.model)
        return self.cost(model, solution.fit.values[: len(solution.model.bases)], solution.fit)[0]


def step_text(step: Array) -> str:
    """The step for the progress display."""
    return (
        f"moved {np.hypot(*step[OFFSET]):.3f} px, range {step[RANGE]:+.5f}, roll {step[ROLL]:+.3f} deg, "
        f"turned {np.linalg.norm(step[ATTITUDE]):.3f} deg, blur {step[PSF]:+.3f}"
    )


def first_weights(model: Model, data: Cutout, settings: JointSettings) -> Array:
    """Weights of the bases before anything is known of the noise. Raises FailedError when too little is usable."""
    weight = np.where(data.usable, 1 / np.maximum(data.variance + (0.05 * data.bright) ** 2, 1e-12), 0)
    if np.count_nonzero(weight) <= 2 * len(model.bases):
        raise FailedError(Reason.NO_USABLE_PIXELS, "no usable pixels lie under the simulated target.")
    even = np.full(len(model.bases), data.bright / len(model.bases))
    problem = brightness_problem(model, data, even, np.full((model.tiles.count, LOCAL), 1e18), settings)
    return solve_linear(problem, weight.astype(np.float32)).values[: len(model.bases)]


def bearable(step: Array, lengthening: Array, limits: IterationThresholds, radius_px: float) -> float:
    """The share of a step (8,) and of the trail's (2,), or none (0,), that the linearisation can bear."""
    share = max(
        np.hypot(*step[OFFSET]) / limits.largest_limb_px,
        abs(step[RANGE]) * radius_px / limits.largest_limb_px,
        abs(step[ROLL]) / limits.largest_turn_deg,
        np.linalg.norm(step[ATTITUDE]) / limits.largest_turn_deg,
        abs(step[PSF]) / limits.largest_psf,
        np.linalg.norm(lengthening) / limits.largest_trail_px,
        1.0,
    )
    return float(1 / share)
