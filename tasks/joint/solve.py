"""The joint estimator: pointing, range, roll, attitude and blur of one image, with its brightness solved along."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.observation import Observation
from tasks.compare.match import framed_window
from tasks.joint.fit import Fit, Problem, solve
from tasks.joint.model import Model, linear_model
from tasks.joint.parameters import ATTITUDE, GROUPS, NAMES, OFFSET, PSF, RANGE, ROLL, State, difference
from tasks.joint.settings import JointSettings
from tasks.simulate import Scene
from tasks.simulate.window import Window, disk_radius_px

Array = NDArray[np.float64]
Image = NDArray[np.float32]
Progress = Callable[[str, int, str], None]

# Beyond these the linearisation is not trusted: px of the limb, degrees, logarithm of the PSF.
LARGEST = {"limb_px": 3.0, "turn_deg": 2.0, "psf": 0.4}
RELATIVE_ERROR = 0.02
# In the order of the unknowns: steps that need not be taken, and that may be left when none lowers the cost.
STILL = np.array([2e-3, 2e-3, 1e-5, 2e-3, 2e-3, 2e-3, 2e-3, 5e-3])
LOOSE = np.array([0.05, 0.05, 5e-4, 0.5, 0.5, 0.5, 0.5, 0.1])
SHARES = (1.0, 0.3, 0.1)


@dataclass(frozen=True)
class Solution:
    """state: where the iterations ended; fit: the last linear problem, its last eight columns the unknowns of
    `parameters.NAMES`, and its problem; model: what it was linearised on."""

    state: State
    fit: Fit
    problem: Problem
    model: Model
    held: NDArray[np.bool_]
    history: list[Array]
    converged: bool


def solve_joint(
    observation: Observation,
    start: State,
    metadata: State,
    scene: Scene,
    settings: JointSettings,
    sigmas: Array,
    progress: Progress | None = None,
) -> Solution:
    """Gauss-Newton from `start`, the geometry rendered anew at each step.

    metadata: where the priors are centred. sigmas: (8,) their 1-sigma, inf where free.
    Raises FailedError when too few pixels are usable or the disk leaves the frame.
    """
    camera = scene.camera
    held = np.zeros(len(NAMES), bool)
    for group in settings.hold:
        held[list(GROUPS[group])] = True
    window = framed_window(scene, start.pose)
    data = _Data(observation, window)
    model = linear_model(scene, start, window, settings)
    weights = first_weights(model, data, settings)
    linear: Fit | None = None
    history: list[Array] = []
    floor = RELATIVE_ERROR
    while True:
        weight, floor = pixel_weights(model, data, weights, linear, floor, settings)
        gain = np.zeros_like(data.image) if linear is None else linear.gain
        moving = model.derivatives(weights, gain)
        moving[held] = 0
        done = difference(model.state, metadata, camera)
        problem = _problem(model, data, weights, settings)
        problem = replace(
            problem,
            columns=np.concatenate([problem.columns, moving]),
            prior=np.concatenate([problem.prior, np.where(held, 1e30, 1 / sigmas**2)]),
            expected=np.concatenate([problem.expected, np.where(held | ~np.isfinite(sigmas), 0, -done)]),
        )
        fit = solve(problem, weight, None if linear is None else linear.residual)
        step = limited(fit.values[-len(NAMES) :] * ~held, scene, model.state)
        error = np.sqrt(np.diag(fit.covariance)[-len(NAMES) :])
        if progress:
            progress("joint", len(history) + 1, told(step))
        converged = bool((np.abs(step) < np.maximum(0.1 * error, STILL)).all())
        if converged or len(history) == settings.max_iterations:
            break
        line = Line(data, weight, metadata, sigmas, held, scene, settings)
        found = line.lower(model, step, fit)
        if found is None:
            # A minimum, as far as the sampling of the simulation can tell.
            converged = bool((np.abs(step) < np.maximum(error, LOOSE)).all())
            break
        model, linear, taken = found
        weights = linear.values[: len(model.bases)]
        history.append(taken)
    return Solution(model.state, fit, problem, model, held, history, converged)


def _problem(model: Model, data: "_Data", weights: Array, settings: JointSettings) -> Problem:
    """The problem of the linear unknowns alone."""
    columns = model.columns()
    tiles = settings.tiles
    local_prior = 1 / np.maximum([tiles.gain, tiles.slope, tiles.slope], 1e-9) ** 2
    nothing = np.zeros(len(columns))
    return Problem(
        data.image, columns, model.local(weights), model.tiles, nothing, nothing, local_prior, settings.huber
    )


@dataclass(frozen=True)
class Line:
    """Looks along a step for a lower cost, everything but the state kept."""

    data: "_Data"
    weight: Image
    metadata: State
    sigmas: Array
    held: NDArray[np.bool_]
    scene: Scene
    settings: JointSettings

    def lower(self, model: Model, step: Array, fit: Fit) -> tuple[Model, Fit, Array] | None:
        """The first of ever shorter steps that lowers the cost: model and linear fit there, and the step taken."""
        weights = fit.values[: len(model.bases)]
        before, _ = self.cost(model, weights, fit)
        for share in SHARES:
            state = model.state.moved(share * step, self.scene.camera)
            moved = linear_model(self.scene, state, model.window, self.settings)
            after, linear = self.cost(moved, weights, fit)
            if after < before:
                return moved, linear, share * step
        return None

    def cost(self, model: Model, weights: Array, fit: Fit) -> tuple[float, Fit]:
        """Cost of the state of `model` with the best linear unknowns, and their fit."""
        linear = solve(_problem(model, self.data, weights, self.settings), self.weight, fit.residual)
        away = difference(model.state, self.metadata, self.scene.camera)
        away[self.held] = 0
        return linear.cost + float(np.sum((away / self.sigmas) ** 2)), linear


def told(step: Array) -> str:
    """The step for the progress display."""
    return (
        f"moved {np.hypot(*step[OFFSET]):.3f} px, range {step[RANGE]:+.5f}, roll {step[ROLL]:+.3f} deg, "
        f"turned {np.linalg.norm(step[ATTITUDE]):.3f} deg, blur {step[PSF]:+.3f}"
    )


@dataclass(frozen=True)
class _Data:
    observation: Observation
    window: Window

    @property
    def image(self) -> Image:
        return np.where(self.usable, self.window.crop(self.observation.image), 0).astype(np.float32)

    @property
    def usable(self) -> NDArray[np.bool_]:
        return self.window.crop(self.observation.usable, fill=False)

    @property
    def variance(self) -> Image:
        return self.window.crop(self.observation.noise, fill=1) ** 2


def first_weights(model: Model, data: _Data, settings: JointSettings) -> Array:
    """Weights of the bases before anything is known of the noise. Raises FailedError when too little is usable."""
    bright = np.percentile(data.image[data.usable], 95) if data.usable.any() else 1.0
    weight = np.where(data.usable, 1 / np.maximum(data.variance + (0.05 * bright) ** 2, 1e-12), 0).astype(np.float32)
    if np.count_nonzero(weight) <= 2 * len(model.bases):
        raise FailedError("no-usable-pixels", "no usable pixels lie under the simulated target.")
    even = np.full(len(model.bases), bright / len(model.bases))
    problem = replace(_problem(model, data, even, settings), local_prior=np.full(3, 1e18))
    return solve(problem, weight).values[: len(model.bases)]


def pixel_weights(
    model: Model, data: _Data, weights: Array, fit: Fit | None, floor: float, settings: JointSettings
) -> tuple[Image, float]:
    """Inverse variance (ny, nx) of image minus model: noise, a relative error of the model (measured on the residuals
    of the last fit), places known to `edge_px`, and no trust near the terminator."""
    bright = model.brightness(weights)
    inside = (model.coverage > 0.99) & data.usable & (model.mu0 > 2 * settings.terminator)
    if fit is not None and inside.sum() > 50:
        relative = fit.residual[inside] / np.maximum(bright[inside], 1e-6)
        noise = np.median(np.sqrt(data.variance[inside]) / np.maximum(bright[inside], 1e-6))
        spread = 1.4826 * float(np.median(np.abs(relative)))
        floor = float(np.clip(np.sqrt(max(spread**2 - noise**2, 0)), 0.002, 0.2))
    gradient_y, gradient_x = np.gradient(bright)
    variance = data.variance + (floor * bright) ** 2 + settings.edge_px**2 * (gradient_x**2 + gradient_y**2)
    if settings.terminator:
        typical = np.percentile(bright[inside], 50) if inside.any() else 1.0
        doubt = 0.3 * np.exp(-model.mu0 / settings.terminator) * (model.coverage > 0.5)
        variance = variance + (doubt * np.minimum(bright + 0.05 * typical, typical)) ** 2
    return np.where(data.usable, 1 / np.maximum(variance, 1e-12), 0).astype(np.float32), floor


def limited(step: Array, scene: Scene, state: State) -> Array:
    """`step` shortened, along its direction, to what the linearisation can bear."""
    radius = disk_radius_px(state.pose, scene.camera, scene.target)
    share = max(
        np.hypot(*step[OFFSET]) / LARGEST["limb_px"],
        abs(step[RANGE]) * radius / LARGEST["limb_px"],
        abs(step[ROLL]) / LARGEST["turn_deg"],
        np.linalg.norm(step[ATTITUDE]) / LARGEST["turn_deg"],
        abs(step[PSF]) / LARGEST["psf"],
        1.0,
    )
    return step / share
