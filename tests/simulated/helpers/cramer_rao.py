"""The least error that any unbiased estimator can have (Cramer-Rao), for comparison."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tasks.compare.match import framed_window
from tasks.joint.gauss_newton import FIXED, brightness_problem, data_at, first_weights, tiles_at
from tasks.joint.model import linear_model
from tasks.joint.normal_equations import solve_linear
from tasks.joint.parameters import NAMES, State
from tasks.joint.problem import Problem
from tasks.joint.tiles import LOCAL, layout_for
from tasks.simulate.window import disk_radius_px


def cramer_rao(given: Problem, truth: State) -> NDArray[np.float64]:
    """1-sigma (8,) of the unknowns at the true state, noise alone, brightness unknown, the map exact; with the priors
    of the problem. Held unknowns have none."""
    scene, settings, held = given.scene, given.settings, given.held
    data = data_at(given, truth, framed_window(scene, truth.pose))
    layout = layout_for(disk_radius_px(truth.pose, scene.camera, scene.target), settings.tiles)
    tiles = tiles_at(truth, scene, data.window, layout)
    model = linear_model(given, truth, data.window, tiles, data.light_behind)
    weights = first_weights(model, data, settings)
    moving = model.derivatives(weights, np.zeros_like(data.image))
    moving[held] = 0
    exact = np.full((model.tiles.count, LOCAL), 1e18)
    problem = brightness_problem(model, data, weights, exact, settings)
    problem = replace(
        problem,
        columns=np.concatenate([problem.columns, moving]),
        prior=np.concatenate([problem.prior, np.where(held, FIXED, 1 / given.sigmas**2)]),
        expected=np.concatenate([problem.expected, np.zeros(len(NAMES))]),
        huber=np.inf,
    )
    weight = np.where(data.usable, 1 / np.maximum(data.variance, 1e-12), 0).astype(np.float32)
    error = np.sqrt(np.diag(solve_linear(problem, weight).covariance)[-len(NAMES) :])
    return np.where(held, 0.0, error)
