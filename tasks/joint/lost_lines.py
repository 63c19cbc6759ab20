"""Lines or columns that the picture lacks, or has twice: what lies beyond them is displaced by whole pixels against the
rest of the disk.

The last linear problem of the solution gets one more unknown for each strip of lines, the displacement of that strip
across the lines, and the same for columns. From there every place for one step is tried, all other unknowns and smooth
displacements solved along, without another rendering.
"""

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from catalog.reasons import Reason
from tasks.joint.displaced_markings import UNSEEN, terms
from tasks.joint.gauss_newton import Solution
from tasks.joint.normal_equations import scaled_inverse, solve_linear
from tasks.joint.parameters import NAMES, OFFSET
from tasks.joint.pyramid import Level
from tasks.joint.thresholds import ContradictionThresholds
from tasks.joint.uncertainty import sampling_covariance

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Step:
    """The likeliest step of the picture. axis: what was lost or repeated. place_px: the first line or column beyond it,
    in the image. size_px: displacement of what lies beyond it against the rest, image's pixels; negative where lines
    are lost, positive where they are repeated. sigma_px: 1-sigma of that, with what map and laws feign."""

    axis: Literal["lines", "columns"]
    place_px: float
    size_px: float
    sigma_px: float

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return asdict(self)


def step_shown(solution: Solution, level: Level) -> Step | None:
    """The step of lines or columns that the residuals of a solution at a level show best, by its size over its error.
    None where limb and markings show too little of the target's place, and where optics are taken for exact."""
    model, problem, limits = solution.model, solution.problem, solution.given.thresholds.contradiction
    expected_px = solution.given.settings.displaced_px
    places = np.indices(model.window.shape, dtype=np.float64)
    radius = model.tiles.radius_px
    per_x, per_y = problem.columns[-len(NAMES) :][OFFSET]
    if expected_px is None or not (per_x.any() and per_y.any()):
        return None
    y, x = ((place - centre) / radius for place, centre in zip(places, model.centre_px[::-1], strict=True))
    smooth = [per_x * u + per_y * v for u, v in terms(x, y)[UNSEEN:]]
    strips = limits.step_strips
    # The outermost strips reach to the window's edges.
    number = [np.clip(np.floor((place + 1) / 2 * strips), 0, strips - 1) for place in (y, x)]
    # The first strip stays: all of them displaced alike is another centre.
    stepped = [per * (which == k) for per, which in zip((per_y, per_x), number, strict=True) for k in range(1, strips)]
    columns = np.asarray([*smooth, *stepped], np.float32) / np.float32(level.n)
    # A strip is free to lie off by what is looked for.
    prior = np.full(len(columns), expected_px**-2)
    prior[len(smooth) :] = limits.step_prior_px**-2
    wider = problem.extended(columns, prior)
    fit = solve_linear(wider, solution.fit.weight)
    noise = sampling_covariance(wider, fit)
    # Everything but the strips is solved along; their own prior is taken out, as one step is tried at a time.
    own = slice(len(smooth), len(columns))
    others = np.r_[: len(smooth), len(columns) : len(fit.values)]
    cross = fit.normal[own][:, others] @ scaled_inverse(fit.normal[np.ix_(others, others)])
    along = np.zeros((len(stepped), len(fit.values)))
    along[:, own], along[:, others] = np.eye(len(stepped)), -cross
    normal = (along @ fit.normal)[:, own] - np.diag(prior[own])
    pull = along @ fit.normal
    score, spread = pull @ fit.values, pull @ noise @ pull.T
    # Row k: all strips of an axis from k on lie off by a pixel.
    beyond = np.kron(np.eye(2), np.triu(np.ones((strips - 1, strips - 1))))
    information = np.einsum("ij,jk,ik->i", beyond, normal, beyond)
    # What the pixels would tell no better than the prior, were they independent, is not looked for.
    looked_at = information > limits.step_prior_px**-2
    if not looked_at.any():
        return None
    information = np.where(looked_at, information, np.inf)
    size = beyond @ score / information
    sigma = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", beyond, spread, beyond), 0)) / information
    mapped = np.ptp(solution.given.scene.basemap.albedo) > 0
    feigned_px = limits.step_feigned_px if mapped else limits.step_unmapped_px
    feigned_px = np.hypot(feigned_px, limits.displaced_share * level.n * radius)
    sigma = np.sqrt(sigma**2 + feigned_px**2 + (limits.step_small_px2 / (level.n * radius)) ** 2)
    best = int(np.argmax(np.abs(size) / np.where(looked_at, sigma, np.inf)))
    by_columns, k = divmod(best, strips - 1)
    centre, corner = model.centre_px[1 - by_columns], (model.window.y0, model.window.x0)[by_columns]
    place_px = level.n * (corner + centre + radius * (2 * (k + 1) / strips - 1))
    return Step("columns" if by_columns else "lines", float(place_px), float(size[best]), float(sigma[best]))


def doubt_of_step(found: Step | None, limits: ContradictionThresholds) -> str | None:
    """The doubt that a step raises which is surely there."""
    if found is None or abs(found.size_px) < limits.step_sigmas * found.sigma_px:
        return None
    what, number = found.axis, max(1, round(abs(found.size_px)))
    return (
        f"{Reason.LINES_MISSING}: from about {what[:-1]} {found.place_px:.0f} on the target lies "
        f"{found.size_px:+.2f} +- {found.sigma_px:.2f} px off against the rest of its disk, as if {number} "
        f"{what if number > 1 else what[:-1]} {'were' if number > 1 else 'was'} "
        f"{'lost' if found.size_px < 0 else 'repeated'} there. Read the file again, or mask one side (--mask)."
    )
