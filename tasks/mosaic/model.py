"""Law and levels of a mosaic's images, from ground that several of them show.

The logarithm of a brightness is the sum of those of the ground's albedo, of the image's level and of the law at the
angles. Albedos and levels are linear in it and are eliminated; what is left depends on the law's parameters alone
(variable projection, Golub and Pereyra 1973, SIAM J. Numer. Anal. 10, 413). So markings of the ground do not disturb
the law, as they would in a fit of one phase function to all the ground.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError, RefusedError
from catalog.reasons import Reason
from catalog.robust import huber_weight, sigma_about_zero
from tasks.mosaic.samples import Samples
from tasks.mosaic.settings import MosaicSettings
from tasks.photometry.laws import PhotometricLaw, find_law

Array = NDArray[np.float64]
HUBER = 2.0
ROUNDS = 4
STEPS_PER_ROUND = 12
SETTLED = 1e-5  # of a parameter's scale
# What changes an image's brightness as a whole, so that images of unknown level do not show it.
WITH_THE_LEVEL = ("mag_per_deg", "b", "c", "b0", "h", "bc0", "hc", "filling")
# An image whose level nobody knows, and that shares no ground with others, is as bright as they are on the average:
# the spread of hemispheres' mean albedos (Europa's leading and trailing side differ by 30 %).
UNKNOWN_LEVEL_SIGMA = 0.3
LEAST_SCATTER = 1e-3


@dataclass(frozen=True)
class Model:
    """values: of all parameters of the law (albedo 1 where it has one); sigma: of the solved. levels (images,): how
    much an image is brighter than ground and law make it; level_sigma (images,): relative, for a known law. scatter:
    relative 1-sigma by which law and albedo miss single images, beyond noise and pose. samples: how many were used;
    shared: cells of the ground that more than one image shows."""

    law: PhotometricLaw
    values: dict[str, float]
    sigma: dict[str, float]
    levels: Array
    level_sigma: Array
    scatter: float
    samples: int
    shared: int


MOST_SAMPLES = 25_000  # for the law; of more, some cells of the ground are left out, with all images that show them


def solve_model(samples: Samples, settings: MosaicSettings) -> Model:
    """Law and levels from the samples. Raises RefusedError for parameters that the law does not have, FailedError when
    no image shows usable ground."""
    law = find_law(settings.law)
    names = {p.name for p in law.parameters}
    if unknown := {*settings.held, *settings.priors} - names:
        fault = f"{law.name} has no {', '.join(sorted(unknown))}."
        raise RefusedError(Reason.PARAMETER_UNKNOWN, fault, f"Has {', '.join(sorted(names))}.")
    if not len(samples.value):
        raise FailedError(Reason.TOO_FEW_PIXELS, "no image shows usable ground within the limits.", "Widen them.")
    part = _Problem(law, thinned(samples, MOST_SAMPLES), settings)
    x, scatter = part.solve()
    whole = _Problem(law, samples, settings) if len(part.logarithm) < len(samples.value) else part
    return whole.model(x, scatter)


def thinned(samples: Samples, most: int) -> Samples:
    """About `most` of the samples: every k-th cell, whole."""
    every = -(-len(samples.value) // most)
    if every == 1:
        return samples
    _, number = np.unique(samples.cell, return_inverse=True)
    kept = number % every == 0
    columns = {
        name: getattr(samples, name)[kept] for name in ("image", "cell", "value", "mu0", "mu", "phase_deg", "noise")
    }
    return Samples(**columns, images=samples.images)


class _Problem:
    """samples by cell and image; unknown: names of the law's parameters that are solved."""

    def __init__(self, law: PhotometricLaw, samples: Samples, settings: MosaicSettings) -> None:
        self.law, self.samples, self.settings = law, samples, settings
        _, self.cell = np.unique(samples.cell, return_inverse=True)
        self.cells = int(self.cell.max()) + 1
        self.shown_by = np.bincount(self.cell)
        self.logarithm = np.log(samples.value)
        self.fixed = {**self._not_shown(), **settings.held}
        if law.scaled:
            self.fixed["albedo"] = 1.0
        solved = [p for p in law.parameters if p.name not in self.fixed]
        self.names = tuple(p.name for p in solved)
        priors = settings.priors
        self.start = np.array([priors[p.name][0] if p.name in priors else p.start for p in solved])
        self.low, self.high = (np.array([getattr(p, end) for p in solved]) for end in ("low", "high"))
        self.expected = np.array([priors[name][0] if name in priors else 0.0 for name in self.names])
        self.information = np.array([priors[name][1] ** -2.0 if name in priors else 0.0 for name in self.names])
        self.level_sigma = settings.calibration_sigma or UNKNOWN_LEVEL_SIGMA
        self.size = np.maximum(np.abs(self.start), 0.05)

    def _not_shown(self) -> dict[str, float]:
        """Parameters that these images cannot determine."""
        used = np.unique(self.samples.image)
        phases = np.array([self.samples.phase_deg[self.samples.image == k].mean() for k in used])
        held = self.law.held_without(phases)
        held |= {p.name: p.held for p in self.law.parameters if p.only_with_prior}
        if self.settings.calibration_sigma is None:
            usual = {p.name: p.held or p.start for p in self.law.parameters}
            held |= {name: usual[name] for name in WITH_THE_LEVEL if name in usual}
        if not (self.shown_by > 1).any():  # the brightness of ground that one image shows is its albedo
            held |= {p.name: p.held or p.start for p in self.law.parameters}
        return {name: value for name, value in held.items() if name not in self.settings.priors}

    def values(self, x: Array) -> dict[str, float]:
        """All parameters."""
        return {**self.fixed, **dict(zip(self.names, x.tolist(), strict=True))}

    def without_law(self, x: Array) -> Array:
        """Logarithm of brightness over law (n,)."""
        s = self.samples
        shape = self.law.reflectance(self.values(x), s.mu0, s.mu, s.phase_deg)
        return np.asarray(self.logarithm - np.log(np.maximum(shape, 1e-9)))

    def jacobian(self, x: Array) -> Array:
        """Of minus `without_law` (n, unknowns)."""
        columns = np.empty((len(self.logarithm), len(x)))
        for k, size in enumerate(self.size):
            ends = []
            for sign in (1, -1):
                moved = x.copy()
                moved[k] = np.clip(x[k] + sign * 1e-4 * size, self.low[k], self.high[k])
                ends.append((moved[k], self.without_law(moved)))
            columns[:, k] = -(ends[0][1] - ends[1][1]) / (ends[0][0] - ends[1][0])
        return columns

    def solve(self) -> tuple[Array, float]:
        """Parameters and scatter."""
        x, scatter = self.start.copy(), 0.03
        weight = 1 / (self.samples.noise**2 + scatter**2)
        y = self.without_law(x)
        for _ in range(ROUNDS):
            elimination = _Elimination(self, weight, self._usual_levels(y))
            x, y = self._steps(x, elimination)
            residual = elimination.of(y)[0]
            scatter = self._scatter(residual)
            weight = self._weights(residual, scatter)
        return x, scatter

    def _weights(self, residual: Array, scatter: float) -> Array:
        sigma = np.sqrt(self.samples.noise**2 + scatter**2)
        return np.asarray(huber_weight(np.abs(residual) / sigma, HUBER) / sigma**2)

    def model(self, x: Array, scatter: float) -> Model:
        """Levels by all samples, for these parameters of the law, and the errors of all."""
        y = self.without_law(x)
        usual = self._usual_levels(y)
        rough = _Elimination(self, 1 / (self.samples.noise**2 + scatter**2), usual)
        elimination = _Elimination(self, self._weights(rough.of(y)[0], scatter), usual)
        _, levels = elimination.of(y)
        jacobian = self.jacobian(x)
        normal = self._normal(jacobian, elimination)
        covariance = np.linalg.pinv(normal, hermitian=True) if len(x) else np.zeros((0, 0))
        return Model(
            law=self.law,
            values=self.values(x),
            sigma=dict(zip(self.names, np.sqrt(np.maximum(np.diag(covariance), 0)).tolist(), strict=True)),
            levels=np.exp(levels - np.average(levels)),
            level_sigma=elimination.level_sigma(),
            scatter=scatter,
            samples=len(y),
            shared=int((self.shown_by > 1).sum()),
        )

    def _usual_levels(self, y: Array) -> Array:
        """What is expected of the levels (images,): nothing, or that images of unknown level show average ground."""
        expected = np.zeros(self.samples.images)
        if self.settings.calibration_sigma is None:
            middle = np.median(y)
            for k in np.unique(self.samples.image):
                expected[k] = np.median(y[self.samples.image == k]) - middle
        return expected

    def _normal(self, jacobian: Array, elimination: "_Elimination") -> Array:
        reduced = (
            np.column_stack([elimination.residual(column) for column in jacobian.T]) if jacobian.size else jacobian
        )
        return np.asarray((jacobian.T * elimination.weight) @ reduced + np.diag(self.information))

    def _steps(self, x: Array, elimination: "_Elimination") -> tuple[Array, Array]:
        """Damped Gauss-Newton steps from x: the parameters, and what is left without the law."""
        y = self.without_law(x)
        if not len(x):
            return x, y
        cost, damping = self._cost(x, y, elimination), 1e-3
        for _ in range(STEPS_PER_ROUND):
            jacobian = self.jacobian(x)
            normal = self._normal(jacobian, elimination)
            residual = elimination.of(y)[0]
            slope = (jacobian.T * elimination.weight) @ residual - self.information * (x - self.expected)
            scale = np.maximum(np.diag(normal), 1e-12 * self.size**-2.0)
            step = np.linalg.solve(normal + np.diag(damping * scale + 1e-9 * scale), slope)
            moved = np.clip(x + step, self.low + 1e-9, self.high - 1e-9)
            there = self.without_law(moved)
            moved_cost = self._cost(moved, there, elimination)
            if moved_cost < cost:
                small = bool((np.abs(moved - x) < SETTLED * self.size).all())
                x, y, cost, damping = moved, there, moved_cost, damping / 5
                if small:
                    break
            else:
                damping *= 8
        return x, y

    def _cost(self, x: Array, y: Array, elimination: "_Elimination") -> float:
        return elimination.cost(y) + float(self.information @ (x - self.expected) ** 2)

    def _scatter(self, residual: Array) -> float:
        """1-sigma of residuals beyond noise and pose, where several images show the ground."""
        several = self.shown_by[self.cell] >= 3
        if several.sum() < 30:
            several = self.shown_by[self.cell] >= 2
        if several.sum() < 10:
            return 0.02
        count = self.shown_by[self.cell][several]
        size = residual[several] * np.sqrt(count / (count - 1))
        found = sigma_about_zero(size) ** 2 - float(np.median(self.samples.noise[several] ** 2))
        return float(np.sqrt(max(found, LEAST_SCATTER**2)))


class _Elimination:
    """Albedos of cells and levels of images taken out by weighted least squares."""

    def __init__(self, problem: _Problem, weight: Array, expected: Array) -> None:
        from scipy.sparse import csr_matrix, diags

        samples = problem.samples
        self.cell, self.image, self.weight, self.expected = problem.cell, samples.image, weight, expected
        self.images, self.cells = samples.images, problem.cells
        self.by_cell = np.bincount(self.cell, weight, minlength=self.cells)
        self.prior = np.full(self.images, problem.level_sigma**-2.0)
        together = csr_matrix((weight, (self.cell, self.image)), shape=(self.cells, self.images))
        by_image = np.bincount(self.image, weight, minlength=self.images)
        coupling = (together.T @ diags(1 / self.by_cell) @ together).toarray()
        self.inverse = np.linalg.inv(np.diag(by_image + self.prior) - coupling)

    def _solve(self, y: Array, expected: Array) -> tuple[Array, Array]:
        """Levels (images,) and residual (n,)."""
        mean = np.bincount(self.cell, self.weight * y, minlength=self.cells) / self.by_cell
        right = np.bincount(self.image, self.weight * (y - mean[self.cell]), minlength=self.images)
        levels = self.inverse @ (right + self.prior * expected)
        rest = y - levels[self.image]
        return levels, rest - (np.bincount(self.cell, self.weight * rest, minlength=self.cells) / self.by_cell)[
            self.cell
        ]

    def residual(self, column: Array) -> Array:
        """What is left of a derivative (n,)."""
        return self._solve(column, np.zeros(self.images))[1]

    def of(self, y: Array) -> tuple[Array, Array]:
        """Residual (n,) and levels (images,)."""
        levels, residual = self._solve(y, self.expected)
        return residual, levels

    def level_sigma(self) -> Array:
        """1-sigma of the levels against their mean (images,), for a known law."""
        centred = np.eye(self.images) - 1 / self.images
        return np.asarray(np.sqrt(np.maximum(np.diag(centred @ self.inverse @ centred.T), 0)))

    def cost(self, y: Array) -> float:
        """Weighted squares of residuals and of the levels against their prior."""
        levels, residual = self._solve(y, self.expected)
        return float(self.weight @ residual**2 + self.prior @ (levels - self.expected) ** 2)
