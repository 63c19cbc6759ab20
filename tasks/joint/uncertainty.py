"""How sure the joint solution is: errors that neighbouring pixels share, what the priors hold, and what no residual
shows."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.target import Target
from tasks.compare.limb_errors import RELIEF_ARC_DEG
from tasks.joint.normal_equations import Fit, LinearProblem, scaled_inverse
from tasks.joint.parameters import ATTITUDE, NAMES, OFFSET, PSF, RANGE, ROLL
from tasks.joint.settings import SystematicSettings

Array = NDArray[np.float64]
MOVING = len(NAMES)
# How many parts of a half-lit limb rise and fall on their own.
INDEPENDENT_LIMBS = round(180 / RELIEF_ARC_DEG)


def covariance(problem: LinearProblem, fit: Fit) -> Array:
    """Covariance (8, 8) of the unknowns that move the image, see `covariance_of_all`."""
    return covariance_of_all(problem, fit)[-MOVING:, -MOVING:]


def covariance_of_all(problem: LinearProblem, fit: Fit) -> Array:
    """Covariance (n, n) of all columns' values when the residuals of neighbouring tiles may all err together
    (cluster-robust sandwich; White 1980, Econometrica 48, 817; Liang and Zeger 1986, Biometrika 73, 13)."""
    bread = scaled_inverse(fit.normal)
    meat = _shared_pull(problem, fit) + np.diag(problem.prior)
    return _at_least(bread @ meat @ bread, bread)


def sampling_covariance(problem: LinearProblem, fit: Fit) -> Array:
    """Covariance (n, n) of all columns' values by the image's errors alone, without those of the priors' means."""
    bread = scaled_inverse(fit.normal)
    return _at_least(bread @ _shared_pull(problem, fit) @ bread, bread @ fit.information @ bread)


def _at_least(sandwich: Array, least: Array) -> Array:
    """Never less than what independent pixels of the stated weight would give."""
    ratio = np.maximum(np.sqrt(np.diag(least) / np.maximum(np.diag(sandwich), 1e-300)), 1.0)
    return np.asarray(sandwich * np.outer(ratio, ratio))


def _shared_pull(problem: LinearProblem, fit: Fit) -> Array:
    """Covariance (n, n) of the residuals' pull on the columns, those of a cluster erring together."""
    scores = _scores(problem, fit)
    count = len(scores)
    shrink = count / (count - min(len(fit.values), problem.thresholds.variance.most_lost * count))
    return np.asarray(shrink * scores.T @ scores)


def noise_covariance(problem: LinearProblem, fit: Fit, variance: Array) -> Array:
    """Covariance (8, 8) of the unknowns that move the image by the pixels' noise alone, of `variance` (ny, nx): what
    another exposure of the same scene would draw anew. Errors of map and laws, which the weights hold too, are not in
    it."""
    label, weight = problem.tiles.label.ravel(), fit.weight.ravel()
    inside = label >= 0
    step = scaled_inverse(fit.normal)[-MOVING:]
    pull = step @ problem.columns.reshape(len(problem.columns), -1)
    # What the tiles' own unknowns take up is no pull on the others.
    for part, column in zip((fit.by_others @ step.T).transpose(1, 2, 0), problem.local, strict=True):
        pull[:, inside] -= part[:, label[inside]] * column.ravel()[inside]
    pull *= np.where(weight > 0, weight * np.sqrt(variance.ravel()), 0)
    return np.asarray(pull @ pull.T)


def _scores(problem: LinearProblem, fit: Fit) -> Array:
    """Each cluster's pull on the unknowns (clusters, n): groups of tiles of the disk, squares of the sky."""
    ny, nx = problem.image.shape
    pull = (fit.weight * fit.residual).ravel()
    side = problem.thresholds.variance.sky_tile_px
    y, x = np.indices((ny, nx)) // side
    sky = problem.tiles.count + y * (nx // side + 1) + x
    near = problem.tiles.neighbourhoods(problem.thresholds.variance.neighbours)
    label = np.where(near >= 0, near, sky).ravel()
    order = np.argsort(label, kind="stable")
    starts = np.flatnonzero(np.diff(label[order], prepend=-1))
    scores = [np.add.reduceat((pull * column.ravel())[order].astype(np.float64), starts) for column in problem.columns]
    kept = np.array(scores).T
    return kept[np.any(kept != 0, axis=1)]


def systematic(
    settings: SystematicSettings,
    radius_px: float,
    distortion_px: float = 0.0,
    levels_px: float = 0.0,
    larger: tuple[float, float] = (1.0, 1.0),
    trail_px: float = 0.0,
) -> Array:
    """Variances (8, 8) that are added for what the residuals cannot show. distortion_px: 1-sigma of the distortion
    model near the disk. levels_px: by how much edges lie off in a picture of few grey levels (see
    `displaced_by_levels`). larger: how many times larger the errors of centre and of range are than those of a usual
    map and PSF (see `times_usual`). trail_px: length of the trail that was solved for."""
    sigma = np.zeros(MOVING)
    averaged_px = settings.local_px / np.sqrt(radius_px)
    by_trail_px = trail_px * settings.trail_radius_px / radius_px
    shared_px = float(np.linalg.norm((settings.distortion_share * distortion_px, levels_px, averaged_px, by_trail_px)))
    sigma[OFFSET] = np.hypot(settings.centre_px * larger[0], shared_px)
    sigma[RANGE] = np.hypot(settings.limb_px * larger[1], shared_px) / radius_px
    sigma[ATTITUDE] = np.hypot(settings.attitude_deg, np.degrees(by_trail_px / radius_px))
    sigma[ROLL] = settings.roll_deg
    return np.diag(sigma**2)


def times_usual(settings: SystematicSettings, blur: float, limb_gain: float) -> tuple[float, float]:
    """How many times larger than usual the systematic errors of centre and of range are. blur: width of the image's
    PSF, a trail included, over the camera's; what map and laws displace grows with it (measured: 0.19 px of the centre
    at 5 px, 0.03 px at 0.9 px). limb_gain: what map and laws get wrong of the limb's brightness (see
    `tile_prior.limb_gain`): an edge is displaced in proportion, and the centre with it; the range, which the whole limb
    tells, by the root of that (25 images whose gains are off by 2 to 21 %: rms z 0.77 by the root, 0.70 in
    proportion)."""
    wider, gain = max(1.0, blur), max(1.0, limb_gain / settings.limb_gain)
    return wider * gain, wider * float(np.sqrt(gain))


def of_the_body(target: Target, radius_px: float, response: Array | None = None, shown_px: float = 0.0) -> Array:
    """Covariance (8, 8) that comes from the target's radius, which the image cannot tell from its range, and from the
    relief of its limb, or what the limb shows of it (shown_px, RMS) where that is more. response: (8, parts) what the
    solution does when a part is a pixel higher (see `relief_response`); without it a half-lit limb is taken to
    rise and fall in INDEPENDENT_LIMBS parts."""
    relief_px = max(target.expected_relief_km / target.mean_radius_km * radius_px, shown_px)
    variance = np.zeros(MOVING)
    if response is None:
        variance[OFFSET] = 2 * relief_px**2 / INDEPENDENT_LIMBS
        variance[RANGE] = (relief_px / radius_px) ** 2 / INDEPENDENT_LIMBS
    variance[RANGE] += ((target.radius_sigma_km or 0.0) / target.mean_radius_km) ** 2
    relief = 0.0 if response is None else relief_px**2 * response @ response.T
    return np.asarray(np.diag(variance) + relief)


def of_the_camera(camera: Camera) -> Array:
    """Variances (8, 8) that come from the focal length, which scales the picture as the range does."""
    variance = np.zeros(MOVING)
    variance[RANGE] = camera.focal_length_sigma**2
    return np.diag(variance)


@dataclass(frozen=True)
class PriorDominated:
    """A direction of the unknowns that the image tells less about than the metadata: combination (8,), in units of the
    prior's sigmas, and the image's own sigma over the prior's."""

    direction: Array
    ratio: float

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON: the unknowns that take part by a tenth or more."""
        parts = {n: round(float(d), 3) for n, d in zip(NAMES, self.direction, strict=True) if abs(d) >= 0.1}
        return {"direction": parts, "image_sigma_over_prior": None if np.isinf(self.ratio) else round(self.ratio, 3)}


def prior_dominated_directions(fit: Fit, robust: Array, sigmas: Array, held: NDArray[np.bool_]) -> list[PriorDominated]:
    """Directions in which the prior, of 1-sigma `sigmas` (8,), says more than the image; by singular values of the
    image's information about the unknowns that have a prior, the others eliminated.

    robust: covariance (8, 8) of the whole fit, by which the information of independent pixels is scaled down.
    """
    bound = np.isfinite(sigmas) & ~held
    bound[PSF] = False
    names = np.flatnonzero(bound)
    if not len(names):
        return []
    formal = np.diag(fit.covariance)[-MOVING:]
    overconfidence = float(np.median(np.diag(robust)[names] / np.maximum(formal[names], 1e-300)))
    n = len(fit.values)
    rows = n - MOVING + names
    others = np.setdiff1d(np.arange(n), np.concatenate([rows, n - MOVING + np.flatnonzero(held)]))
    inner, cross = fit.information[np.ix_(others, others)], fit.information[np.ix_(others, rows)]
    schur = fit.information[np.ix_(rows, rows)] - cross.T @ scaled_inverse(inner) @ cross
    scale = sigmas[names]
    values, vectors = np.linalg.eigh(schur * np.outer(scale, scale) / max(overconfidence, 1.0))
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value < 1:
            direction = np.zeros(MOVING)
            direction[names] = vector
            found.append(PriorDominated(direction, float(1 / np.sqrt(value)) if value > 1e-6 else float("inf")))
    return found
