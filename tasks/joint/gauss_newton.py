"""The joint estimator: pointing, range, roll, attitude and blur of one image, with its brightness solved along."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.reasons import Reason
from tasks.compare.match import framed_window
from tasks.compare.occulted import light_behind
from tasks.joint.cutout import Cutout
from tasks.joint.model import Model, linear_model
from tasks.joint.normal_equations import Fit, LinearProblem, solve
from tasks.joint.parameters import ATTITUDE, GROUPS, NAMES, OFFSET, PSF, RANGE, ROLL, State, difference
from tasks.joint.settings import JointSettings
from tasks.joint.tiles import LOCAL, Layout, Tiles, layout_for, tiles_of
from tasks.joint.variance_model import VarianceModel
from tasks.simulate import Scene
from tasks.simulate.window import Window, disk_radius_px

Array = NDArray[np.float64]
Image = NDArray[np.float32]
Progress = Callable[[str, int, str], None]

# Beyond these the linearisation is not trusted: px of the limb, degrees, logarithm of the PSF.
LARGEST = {"limb_px": 3.0, "turn_deg": 2.0, "psf": 0.4, "trail_px": 1.5}
# In the order of the unknowns: steps that need not be taken, and that may be left when none lowers the cost.
STILL = np.array([4e-3, 4e-3, 2e-5, 1e-2, 1e-2, 1e-2, 1e-2, 5e-3])
LOOSE = np.array([0.05, 0.05, 5e-4, 0.5, 0.5, 0.5, 0.5, 0.1])
# Steps of this share of their own error move nothing that matters.
AT_REST = 0.3
# Where no share of a step lowers the cost it is a minimum, as far as the sampling can tell, unless the step is huge.
NEGLECTED = 0.03
# Steps of a smeared exposure's trail that need not be taken, px.
TRAIL_STILL_PX = 0.03
SHARES = (1.0, 0.3, 0.1, 0.03)
# Tiles lie still while the disk moves under them by no more: the cost would jump where pixels change tiles.
STALE_PX = 0.7
# The variances are learned after so many steps, no more: they and the solution could alternate for ever.
LEARNING = 4


@dataclass(frozen=True)
class Solution:
    """state: where the iterations ended; fit: the last linear problem, its last eight columns the unknowns of
    `parameters.NAMES`, and its problem; model: what it was linearised on; data: the pixels; left: the step (8,) that
    was not taken any more."""

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


def solve_joint(
    observation: Observation,
    start: State,
    metadata: State,
    scene: Scene,
    settings: JointSettings,
    sigmas: Array,
    progress: Progress | None = None,
    warm: Solution | None = None,
) -> Solution:
    """Gauss-Newton from `start`, the geometry rendered anew at each step.

    metadata: where the priors are centred. sigmas: (8,) their 1-sigma, inf where free. warm: an earlier solution, of
    other sampling for instance, whose tiles and trust are taken over.
    Raises FailedError when too few pixels are usable or the disk leaves the frame.
    """
    camera = scene.camera
    held = np.zeros(len(NAMES), bool)
    for group in settings.hold:
        held[list(GROUPS[group])] = True
    window = framed_window(scene, start.pose)
    data = data_at(observation, start, scene, window)
    radius = disk_radius_px(start.pose, camera, scene.target)
    layout = warm.model.tiles.layout if warm else layout_for(radius, settings.tiles)
    model = linear_model(scene, start, window, tiles_at(start, scene, window, layout), settings, data.light_behind)
    variances = warm.variances if warm else VarianceModel.at_first(model, settings)
    weights = first_weights(model, data, settings)
    linear = solve(
        linear_problem(model, data, weights, variances.tiles, settings),
        variances.weight(model, data, weights, settings),
    )
    weights = linear.values[: len(model.bases)]
    history: list[Array] = []
    while True:
        weight = variances.weight(model, data, weights, settings)
        moving = model.derivatives(weights, linear.gain)
        moving[held] = 0
        smear = model.trail_columns(weights, linear.gain)
        done = difference(model.state, metadata, camera)
        problem = linear_problem(model, data, weights, variances.tiles, settings)
        problem = replace(
            problem,
            columns=np.concatenate([problem.columns, smear, moving]),
            prior=np.concatenate([problem.prior, np.zeros(len(smear)), np.where(held, 1e30, 1 / sigmas**2)]),
            expected=np.concatenate(
                [problem.expected, np.zeros(len(smear)), np.where(held | ~np.isfinite(sigmas), 0, -done)]
            ),
        )
        fit = solve(problem, weight, linear.residual)
        full = fit.values[-len(NAMES) :] * ~held
        lengthening = fit.values[len(fit.values) - len(NAMES) - len(smear) : -len(NAMES)]
        share = bearable(full, lengthening, scene, model.state)
        step, lengthened = share * full, share * lengthening
        error = np.sqrt(np.diag(fit.covariance)[-len(NAMES) :])
        if progress:
            progress("joint", len(history) + 1, step_text(step))
        converged = bool((np.abs(step) < np.maximum(AT_REST * error, STILL)).all())
        converged = converged and bool((np.abs(lengthened) < TRAIL_STILL_PX).all())
        if converged or len(history) == settings.max_iterations:
            break
        line = Line(data, weight, variances.tiles, metadata, sigmas, held, scene, settings)
        found = line.lower(model, step, lengthened, fit)
        if found is None:
            converged = bool((NEGLECTED * np.abs(step) < np.maximum(error, LOOSE)).all())
            break
        model, linear, taken = found
        weights = linear.values[: len(model.bases)]
        history.append(taken)
        if len(history) <= LEARNING:
            variances = variances.learned(model, data, weights, linear, settings)
        fresh = tiles_at(model.state, scene, window, layout)
        if fresh.away_px(model.tiles) > STALE_PX:
            model = replace(model, tiles=fresh)
    return Solution(model.state, fit, problem, model, data, held, history, step, converged, variances)


def data_at(observation: Observation, state: State, scene: Scene, window: Window) -> Cutout:
    """The pixels under a window, and what the target hides of a body behind it."""
    return Cutout(observation, window, light_behind(observation, state.pose, scene, window))


def tiles_at(state: State, scene: Scene, window: Window, layout: Layout) -> Tiles:
    """Tiles about the disk at `state`."""
    centre = scene.camera.project(state.pose.target_in_camera_km) - (window.x0, window.y0)
    return tiles_of(window.shape, centre, disk_radius_px(state.pose, scene.camera, scene.target), layout)


def linear_problem(
    model: Model, data: Cutout, weights: Array, local_prior: Array, settings: JointSettings
) -> LinearProblem:
    """The problem of the linear unknowns alone."""
    columns = model.columns(weights)
    prior = np.zeros(len(columns))
    laws = len(model.bases)
    prior[:laws] = (settings.law_weight * data.bright) ** -2
    prior[laws : laws + len(settings.wings_px)] = settings.wings_sigma**-2
    expected = np.zeros_like(prior)
    if model.hides:
        share, sigma = data.hidden_share
        prior[laws - 1], expected[laws - 1] = 1 / (settings.hidden_sigma**2 + sigma**2), share
    return LinearProblem(
        data.image, columns, model.local(weights), model.tiles, prior, expected, local_prior, settings.huber
    )


@dataclass(frozen=True)
class Line:
    """Looks along a step for a lower cost, everything but the state kept."""

    data: Cutout
    weight: Image
    local_prior: Array
    metadata: State
    sigmas: Array
    held: NDArray[np.bool_]
    scene: Scene
    settings: JointSettings

    def lower(self, model: Model, step: Array, lengthened: Array, fit: Fit) -> tuple[Model, Fit, Array] | None:
        """The first of ever shorter steps that lowers the cost: model and linear fit there, and the step taken."""
        weights = fit.values[: len(model.bases)]
        before, _ = self.cost(model, weights, fit)
        error = np.sqrt(np.diag(fit.covariance)[-len(NAMES) :])
        for share in SHARES if (np.abs(step) > error).any() else SHARES[:2]:
            state = model.state.moved(share * step, self.scene.camera).trailed(share * lengthened)
            moved = linear_model(self.scene, state, model.window, model.tiles, self.settings, self.data.light_behind)
            after, linear = self.cost(moved, weights, fit)
            if after < before:
                return moved, linear, share * step
        return None

    def cost(self, model: Model, weights: Array, fit: Fit) -> tuple[float, Fit]:
        """Cost of the state of `model` with the best linear unknowns, and their fit."""
        linear = solve(
            linear_problem(model, self.data, weights, self.local_prior, self.settings), self.weight, fit.residual
        )
        away = difference(model.state, self.metadata, self.scene.camera)
        away[self.held] = 0
        return linear.cost + float(np.sum((away / self.sigmas) ** 2)), linear

    def cost_at(self, solution: Solution, state: State) -> float:
        """Cost of another state than the solution's, everything else kept and the linear unknowns solved anew."""
        window, tiles = solution.model.window, solution.model.tiles
        model = linear_model(self.scene, state, window, tiles, self.settings, self.data.light_behind)
        return self.cost(model, solution.fit.values[: len(solution.model.bases)], solution.fit)[0]


def line_of(
    solution: Solution, observation: Observation, metadata: State, scene: Scene, settings: JointSettings, sigmas: Array
) -> Line:
    """By what `solution` was judged, to judge other states with: arguments as of `solve_joint`."""
    data = replace(solution.data, observation=observation)
    weights = solution.fit.values[: len(solution.model.bases)]
    weight = solution.variances.weight(solution.model, data, weights, settings)
    return Line(data, weight, solution.variances.tiles, metadata, sigmas, solution.held, scene, settings)


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
    problem = linear_problem(model, data, even, np.full((model.tiles.count, LOCAL), 1e18), settings)
    return solve(problem, weight.astype(np.float32)).values[: len(model.bases)]


def bearable(step: Array, lengthening: Array, scene: Scene, state: State) -> float:
    """The share of a step (8,) and of the trail's (2,), or none (0,), that the linearisation can bear."""
    radius = disk_radius_px(state.pose, scene.camera, scene.target)
    share = max(
        np.hypot(*step[OFFSET]) / LARGEST["limb_px"],
        abs(step[RANGE]) * radius / LARGEST["limb_px"],
        abs(step[ROLL]) / LARGEST["turn_deg"],
        np.linalg.norm(step[ATTITUDE]) / LARGEST["turn_deg"],
        abs(step[PSF]) / LARGEST["psf"],
        np.linalg.norm(lengthening) / LARGEST["trail_px"],
        1.0,
    )
    return float(1 / share)
