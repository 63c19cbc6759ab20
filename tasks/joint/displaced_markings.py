"""Distortion that no file tells of, as the disk itself shows it, and what it does to the solution.

A smooth displacement of the image over the disk has a part that looks like another centre, range or roll, and is in no
residual. The parts that look like none of these (shear, and terms of second order in the place) are in the residuals of
limb and markings. They are found from the last linear problem, and what the solution moves by under such a displacement
is added to its errors: the part that cannot be seen is taken to be as large as that.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.joint.beam_bending import response_to
from tasks.joint.contradiction import chi_square
from tasks.joint.gauss_newton import Solution
from tasks.joint.normal_equations import solve_linear
from tasks.joint.parameters import NAMES, OFFSET
from tasks.joint.uncertainty import covariance_of_all

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Displacement:
    """chi_square: of the terms found. rms_px: of the displacement over the disk, in the solution's pixels. response:
    (8,) what the solution moves by under it. least_px, chance: what counts."""

    chi_square: float
    rms_px: float
    response: Array
    least_px: float
    chance: float

    @property
    def is_shown(self) -> bool:
        """Whether there is more than chance gives."""
        return self.rms_px > self.least_px and self.chi_square > chi_square(TERMS, self.chance)

    @property
    def moved(self) -> Array:
        """(8,) by how much the solution may be off; nothing where no displacement is shown."""
        return self.response if self.is_shown else np.zeros(len(NAMES))

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"chi_square": self.chi_square, "rms_px": self.rms_px, "is_shown": self.is_shown}


def terms(x: Array, y: Array) -> list[tuple[Array, Array]]:
    """Displacements (x, y), of pixels at places in units of the disk's radius: shear, then second order."""
    none = np.zeros_like(x)
    second = (x * x - y * y, x * y, x * x + y * y)
    return [(x, -y), (y, x), *((each, none) for each in second), *((none, each) for each in second)]


TERMS = 8


def displacement_shown(solution: Solution, least_px: float) -> Displacement:
    """The displacement by the solution's last linear problem, all its unknowns solved along."""
    model, problem, limits = solution.model, solution.problem, solution.given.thresholds
    chance = limits.contradiction.displaced_chance
    y, x = np.indices(model.window.shape, dtype=np.float64)
    inside = model.coverage > limits.variance.limb_cover
    x, y = (
        np.where(inside, (place - centre) / model.tiles.radius_px, 0.0)
        for place, centre in zip((x, y), model.centre_px, strict=True)
    )
    along = terms(x, y)
    per_x, per_y = problem.columns[-len(NAMES) :][OFFSET]
    if not (per_x.any() and per_y.any()):
        return Displacement(0.0, 0.0, np.zeros(len(NAMES)), least_px, chance)
    columns = np.stack([per_x * u + per_y * v for u, v in along]).astype(np.float32)
    wider = problem.extended(columns, np.full(TERMS, limits.contradiction.displaced_expected_px**-2))

    fit = solve_linear(wider, solution.fit.weight)
    strength = fit.values[:TERMS]
    covariance = covariance_of_all(wider, fit)[:TERMS, :TERMS]
    squares = float(strength @ np.linalg.pinv(covariance, hermitian=True) @ strength)
    total = [sum(s * field[axis][inside] for s, field in zip(strength, along, strict=True)) for axis in (0, 1)]
    rms_px = float(np.sqrt(np.mean(np.square(total)) * 2)) if inside.any() else 0.0
    response = response_to(solution, np.tensordot(np.float32(strength), columns, 1))
    return Displacement(squares, rms_px, response, least_px, chance)
