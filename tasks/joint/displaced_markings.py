"""Distortion that no file tells of, as the disk itself shows it, and what it does to the solution.

A smooth displacement of the image over the disk has parts that look like another centre, range or roll, and are in no
residual. Other parts look like none of these: shear, and terms of second order in the place. They are in the residuals
of limb and markings, and are found from the last linear problem. Their common size, beyond what noise and the map's
errors make of it, is estimated by moments; the parts that cannot be seen are taken to be as large, each independent of
the others, and what the solution moves by under all of them is added to its errors.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.joint.contradiction import size_of
from tasks.joint.gauss_newton import Solution
from tasks.joint.normal_equations import scaled_inverse, solve_linear
from tasks.joint.parameters import NAMES, OFFSET
from tasks.joint.pyramid import Level
from tasks.joint.uncertainty import sampling_covariance

Array = NDArray[np.float64]

# Terms that look like another range and roll, and those that look like nothing else.
UNSEEN, SEEN = 2, 8
# Inverse variance of what is held, in units of that of what is free.
HELD = 1e8


@dataclass(frozen=True)
class Displacement:
    """In pixels of the image, at the limb. size_px: 1-sigma of each term of the displacement; 0 where there is no more
    than chance gives. found_px: the terms that were found (SEEN,); noise: (SEEN, SEEN) covariance of what noise and map
    make of them. response: (8, UNSEEN + SEEN) what the solution moves by under a pixel of each term."""

    size_px: float
    found_px: Array
    noise: Array
    response: Array

    @property
    def covariance(self) -> Array:
        """(8, 8) of what the solution may be off by."""
        return np.asarray(self.size_px**2 * self.response @ self.response.T)

    def at_most(self, size_px: float) -> "Displacement":
        """The same with terms of this size at most: a map's errors displace markings, but not the limb."""
        return replace(self, size_px=min(self.size_px, size_px))

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        noise_px = np.sqrt(np.diag(self.noise))
        return {"size_px": self.size_px, "found_px": self.found_px.tolist(), "noise_px": noise_px.tolist()}


def terms(x: Array, y: Array) -> list[tuple[Array, Array]]:
    """Displacements (x, y), of pixels at places in units of the disk's radius: scale and rotation, shear, then second
    order, without its mean over a disk."""
    none = np.zeros_like(x)
    second = (x * x - y * y, 2 * x * y, x * x + y * y - 0.5)
    linear = [(x, y), (-y, x), (x, -y), (y, x)]
    return [*linear, *((each, none) for each in second), *((none, each) for each in second)]


def displacement_shown(solution: Solution, level: Level, expected_px: float) -> Displacement:
    """The displacement by the last linear problem of the solution at a level, all its unknowns solved along.
    expected_px: 1-sigma of each of its terms before the fit, pixels of the image."""
    model, problem, limits = solution.model, solution.problem, solution.given.thresholds
    y, x = np.indices(model.window.shape, dtype=np.float64)
    x, y = ((place - centre) / model.tiles.radius_px for place, centre in zip((x, y), model.centre_px, strict=True))
    per_x, per_y = problem.columns[-len(NAMES) :][OFFSET]
    if not (per_x.any() and per_y.any()):
        none = np.zeros((len(NAMES), UNSEEN + SEEN))
        return Displacement(0.0, np.zeros(SEEN), np.eye(SEEN) * expected_px**2, none)
    # Per pixel of the image.
    columns = np.stack([per_x * u + per_y * v for u, v in terms(x, y)]).astype(np.float32) / np.float32(level.n)
    prior = np.full(UNSEEN + SEEN, expected_px**-2)
    prior[:UNSEEN] *= HELD
    wider = problem.extended(columns, prior)
    fit = solve_linear(wider, solution.fit.weight)
    count, seen = len(prior), slice(UNSEEN, UNSEEN + SEEN)

    # What the image's errors make of the terms, and what share of them passes through their prior.
    noise = sampling_covariance(wider, fit)[seen, seen]
    passed = np.eye(SEEN) - scaled_inverse(fit.normal)[seen, seen] / expected_px**2
    size_px = size_of(
        fit.values[seen], np.diag(noise), np.diag(passed @ passed.T), expected_px, limits.contradiction.chance_size
    )
    cross = scaled_inverse(fit.normal[count:, count:]) @ fit.information[count:, :count]
    response = level.step_up(np.ones(len(NAMES)))[:, None] * cross[-len(NAMES) :]
    response[solution.held] = 0
    return Displacement(size_px, fit.values[seen], noise, response)
