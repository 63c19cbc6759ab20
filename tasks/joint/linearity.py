"""Whether the detector's signal is proportional to light, as the disk itself tells, and what it does if it is not; and
what grey levels do that are farther apart than the noise.

A signal that goes with light to the power 1 + c differs from one that is proportional by c B ln(B / B_max), to first
order (B: the disk's brightness). Most of it is taken up by the photometric laws; what is left lies at the blurred limb
and moves it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.joint.beam_bending import response_to
from tasks.joint.gauss_newton import Solution
from tasks.joint.normal_equations import solve_linear
from tasks.joint.parameters import NAMES
from tasks.joint.uncertainty import covariance_of_all

Array = NDArray[np.float64]

# 1-sigma of the power that is as good as not held at all.
FREE = 10.0
# A blurred edge is so many times the PSF's sigma wide: its height over its steepest slope.
EDGE_WIDTH = float(np.sqrt(2 * np.pi))


@dataclass(frozen=True)
class Linearity:
    """power: by how much the power of the signal exceeds 1, as the disk has it; sigma: its 1-sigma. response: (8,) what
    the solution moves by per unit of power, in its own pixels. least_sigmas: what counts."""

    power: float
    sigma: float
    response: Array
    least_sigmas: float

    @property
    def is_shown(self) -> bool:
        """Whether the disk shows a power other than 1 by more than chance."""
        return abs(self.power) > self.least_sigmas * self.sigma

    @property
    def moved(self) -> Array:
        """(8,) by how much the solution is off with a signal of this power; nothing where it is not shown."""
        return self.power * self.response if self.is_shown else np.zeros(len(NAMES))

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"power": 1 + self.power, "sigma": self.sigma, "is_shown": self.is_shown}


def linearity_of(solution: Solution) -> Linearity:
    """The power of the signal by the solution's last linear problem, all its unknowns solved along."""
    model, limits = solution.model, solution.given.thresholds.contradiction
    bright = np.maximum(model.brightness(solution.fit.values[: len(model.bases)]) * (1 + solution.fit.gain), 0)
    peak = max(float(bright.max()), 1e-12)
    share = bright / np.float32(peak)
    column = (bright * np.log(np.maximum(share, np.float32(1e-6)))).astype(np.float32)
    column[solution.fit.weight <= 0] = 0
    problem = solution.problem.extended(column[None], np.array([FREE**-2]))

    fit = solve_linear(problem, solution.fit.weight)
    sigma = float(np.hypot(np.sqrt(covariance_of_all(problem, fit)[0, 0]), limits.linearity_laws))
    return Linearity(float(fit.values[0]), sigma, response_to(solution, column), limits.linearity_sigmas)


def displaced_by_levels(picture: NDArray[Any], noise: float, bright: float, psf_px: float) -> float:
    """By how much, px, an edge may lie off in a `picture` (n,) of few grey levels: half a level, which is the same
    along much of a limb, over the slope of an edge of height `bright` blurred by `psf_px`. Noise, 1-sigma before
    the values were rounded, averages it out by exp(-2 (pi noise / level)^2), the first harmonic of the error of
    rounding (Widrow and Kollar 2008, Quantization Noise). 0 for values that are not on levels."""
    values = np.unique(picture)
    if len(values) < 2:
        return 0.0
    level = float(np.median(np.diff(values)))
    dithered = float(np.exp(-2 * (np.pi * noise / level) ** 2))
    return 0.5 * level / bright * EDGE_WIDTH * psf_px * dithered
