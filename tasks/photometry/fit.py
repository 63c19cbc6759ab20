"""A law's parameters from the pixels of a region, with a calibration factor of every image as nuisance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError, RefusedError
from catalog.reasons import Reason
from catalog.robust import huber_weight, sigma_about_zero
from tasks.photometry.fit_settings import FitSettings
from tasks.photometry.laws import PhotometricLaw, Values
from tasks.photometry.region import RegionPixels

Array = NDArray[np.float64]
HUBER = 2.5
ROUNDS = 3
QUICK_PIXELS = 2000
STEP = 1e-4
AT_BOUND = 1e-3
FEWEST_TILES_PER_UNKNOWN = 3.0
SCALE = "scale"


@dataclass(frozen=True)
class PhotometricFit:
    """values: of all parameters, held ones too (`scale`: image units per I/F of laws that need it). sigma: 1-sigma of
    the solved ones; at_bound: those that ran into a limit, whose sigma means nothing. names, covariance (n, n): of the
    solved. calibration, calibration_sigma (images,): factors of the images. residual (pixels,): relative to the
    image's median brightness; model (pixels,). rms (images,): of the residuals. tiles: patches of ground; method:
    where the uncertainties come from. absolute: whether the albedo of a law that has one is I/F, not in image units."""

    law: str
    values: dict[str, float]
    sigma: dict[str, float]
    held: dict[str, float]
    at_bound: tuple[str, ...]
    names: tuple[str, ...]
    covariance: Array
    calibration: Array
    calibration_sigma: Array
    model: Array
    residual: Array
    rms: Array
    tiles: int
    method: str
    absolute: bool = True


def fit_law(law: PhotometricLaw, pixels: RegionPixels, settings: FitSettings | None = None) -> PhotometricFit:
    """Robust least squares of brightness = factor of the image * albedo * law, over all pixels.

    Residuals count relative to each image's median brightness and scatter; outliers are down-weighted (Huber). The
    uncertainties are those of the sandwich covariance with patches of ground as the units that are independent of each
    other (Liang and Zeger 1986, Biometrika 73, 13): markings make neighbouring pixels, and the same ground in several
    images, err together. Raises RefusedError for an unknown parameter in `held`, FailedError when the region has too
    few pixels or no light.
    """
    problem = _Problem(law, pixels, settings or FitSettings())
    solution, weight = problem.solve()
    covariance, method = problem.covariance(solution, weight)
    if problem.settings.bootstrap:
        covariance, method = problem.bootstrapped(solution), f"bootstrap of {problem.settings.bootstrap}"
    return problem.result(solution, covariance, method)


class _Problem:
    """Unknowns x: the solved parameters, then the images' logarithmic factors."""

    def __init__(self, law: PhotometricLaw, pixels: RegionPixels, settings: FitSettings) -> None:
        self.law, self.pixels, self.settings = law, pixels, settings
        mean_phases = np.array([pixels.mean_phase_deg(i) for i in range(len(pixels.products))])
        undetermined = {p.name: p.held for p in law.parameters if p.only_with_prior}
        undetermined |= law.held_without(mean_phases)
        given = {**settings.priors, **settings.bounds}
        self.held = {name: value for name, value in undetermined.items() if name not in given} | settings.held
        self.level = self._levels()
        bounds = self._bounds()
        self.names = tuple(name for name in bounds if name not in self.held)
        self.start, self.low, self.high = (np.array([bounds[n][k] for n in self.names]) for k in range(3))
        self.images = len(pixels.products) if settings.calibration_sigma > 0 and len(pixels.products) > 1 else 0
        self.low = np.concatenate([self.low, np.full(self.images, -3.0)])
        self.high = np.concatenate([self.high, np.full(self.images, 3.0)])
        self.prior = np.concatenate(
            [np.zeros(len(self.names)), np.full(self.images, settings.calibration_sigma or 1.0) ** -2.0]
        )
        self.expected = np.zeros(len(self.prior))
        for name, (value, sigma) in settings.priors.items():
            if name in self.names:
                self.expected[self.names.index(name)] = value
                self.prior[self.names.index(name)] = sigma**-2.0
        _, self.tile = np.unique(pixels.tile, return_inverse=True)
        if len(pixels.value) < 5 * (len(self.names) + self.images):
            raise FailedError(Reason.TOO_FEW_PIXELS, "the region has too few pixels for this law.", "Widen it.")

    def _bounds(self) -> dict[str, tuple[float, float, float]]:
        """Start, lower and upper limit of the parameters that may be solved; holds the images' scale where it is known.
        Raises RefusedError for settings of a parameter that the law does not have, or limits without room."""
        law, settings = self.law, self.settings
        bounds = {p.name: (p.start, p.low, p.high) for p in law.parameters}
        known = {*bounds, SCALE}
        if unknown := {*settings.held, *settings.priors, *settings.bounds} - known:
            fault = f"{law.name} has no {', '.join(sorted(unknown))}."
            raise RefusedError(Reason.PARAMETER_UNKNOWN, fault, f"Has {', '.join(bounds)}.")
        if settings.units_per_if is not None:
            self.held[SCALE] = settings.units_per_if
        if law.scaled:
            bounds["albedo"] = (2 * float(np.median(self.level)) / self.held.get(SCALE, 1.0), 1e-9, np.inf)
        elif SCALE not in self.held:
            bounds[SCALE] = (3 * float(np.median(self.level)), 1e-12, np.inf)
        for name, (value, _) in settings.priors.items():
            bounds[name] = (value, *bounds[name][1:])
        for name, (low, high) in settings.bounds.items():
            if not low < high:
                raise RefusedError(
                    Reason.PARAMETER_UNKNOWN, f"{name} has no room from {low} to {high}.", "Exchange them."
                )
            bounds[name] = (bounds[name][0], low, high)
        inside = {n: (float(np.clip(start, low, high)), low, high) for n, (start, low, high) in bounds.items()}
        return {n: each for n, each in inside.items() if n != SCALE or not law.scaled}

    def _levels(self) -> Array:
        """Median brightness of each image."""
        values, image = self.pixels.value, self.pixels.image
        level = np.array([np.median(values[image == i]) for i in range(len(self.pixels.products))])
        if (level <= 0).any():
            dark = self.pixels.products[int(np.argmin(level))]
            raise FailedError(Reason.NO_LIGHT, f"{dark} shows no light in the region.", "Lower --max-incidence-deg.")
        return level

    def values(self, x: Array) -> Values:
        """All parameters by name."""
        return {**self.held, **dict(zip(self.names, x[: len(self.names)].tolist(), strict=True))}

    def model(self, x: Array) -> Array:
        """Brightness (pixels,)."""
        p, values = self.pixels, self.values(x)
        factor = np.exp(x[len(self.names) :])[p.image] if self.images else 1.0
        return np.asarray(
            factor * values.get(SCALE, 1.0) * p.albedo * self.law.reflectance(values, p.mu0, p.mu, p.phase_deg)
        )

    def residual(self, x: Array) -> Array:
        """(pixels,), relative to the image's median."""
        return np.asarray((self.pixels.value - self.model(x)) / self.level[self.pixels.image])

    def jacobian(self, x: Array) -> Array:
        """Of minus the residual (pixels, unknowns)."""
        model = self.model(x)
        level = self.level[self.pixels.image]
        columns = np.zeros((len(model), len(x)))
        for k in range(len(self.names)):
            step = STEP * max(abs(x[k]), 0.01)
            ends = [np.clip(x[k] + sign * step, self.low[k], self.high[k]) for sign in (-1, 1)]
            low, high = (self.model(np.where(np.arange(len(x)) == k, end, x)) for end in ends)
            columns[:, k] = (high - low) / (ends[1] - ends[0]) / level
        if self.images:
            columns[np.arange(len(model)), len(self.names) + self.pixels.image] = model / level
        return columns

    def solve(self, drawn: Array | None = None, start: Array | None = None) -> tuple[Array, Array]:
        """Unknowns, and the weights (pixels,) of the last round. drawn (pixels,): how often each pixel counts."""
        counts = np.ones(len(self.pixels.value)) if drawn is None else drawn
        first = self._best_start() if start is None else start
        return self._from(first, counts, ROUNDS if start is None else 1)[:2]

    def _best_start(self) -> Array:
        """The start whose quick fit, to a part of the pixels, leaves the least."""
        starts = self._starts()
        if len(starts) == 1:
            return starts[0]
        part = np.zeros(len(self.pixels.value))
        part[:: -(-len(part) // QUICK_PIXELS)] = 1
        found = [self._from(first, part, 1) for first in starts]
        return min(found, key=lambda each: each[2])[0]

    def _starts(self) -> list[Array]:
        first = np.concatenate([self.start, np.zeros(self.images)])
        if self.law.scaled:
            return [first]
        starts = []
        for w, b, theta in ((0.9, -0.3, 15.0), (0.6, -0.2, 25.0), (0.97, -0.45, 8.0)):
            other = first.copy()
            for name, value in (("w", w), ("b", b), ("theta_deg", theta)):
                if name in self.names and name not in self.settings.priors:
                    place = self.names.index(name)
                    other[place] = np.clip(value, self.low[place], self.high[place])
            starts.append(other)
        return starts

    def _from(self, first: Array, counts: Array, rounds: int) -> tuple[Array, Array, float]:
        """Unknowns, weights and cost after some rounds of weighting."""
        from scipy.optimize import least_squares

        x, weight, cost = first, self._weights(first, counts)[0], np.inf
        root_prior = np.sqrt(self.prior)
        scale = np.where(x != 0, np.abs(x), 0.05)
        for _ in range(rounds):
            root = np.sqrt(weight)
            fit = least_squares(
                lambda y, root=root: np.concatenate([root * self.residual(y), root_prior * (y - self.expected)]),
                x,
                jac=lambda y, root=root: np.vstack([-root[:, None] * self.jacobian(y), np.diag(root_prior)]),
                bounds=(self.low, self.high),
                x_scale=scale,
                max_nfev=40,
                ftol=1e-6,
                xtol=1e-6,
            )
            x = np.asarray(fit.x)
            weight, cost = self._weights(x, counts)
        return x, weight, cost

    def _weights(self, x: Array, counts: Array) -> tuple[Array, float]:
        """Inverse variances after Huber's down-weighting, and the mean size of the residuals."""
        residual = self.residual(x)
        image = self.pixels.image
        spread = np.array([sigma_about_zero(residual[image == i]) for i in range(len(self.level))])
        noise = self.pixels.noise / self.level[image] if self.pixels.noise is not None else np.zeros(len(image))
        usual = np.array([np.median(noise[image == i]) for i in range(len(self.level))])
        sigma = np.sqrt(np.maximum(spread**2 - usual**2, (1e-6 + 0.1 * spread) ** 2)[image] + noise**2)
        size = np.abs(residual) / sigma
        weight = counts * huber_weight(size, HUBER) / sigma**2
        return weight, float(np.average(np.abs(residual), weights=counts))

    def covariance(self, x: Array, weight: Array) -> tuple[Array, str]:
        """Sandwich with patches of ground as clusters; with few of them the least-squares one, scaled by residuals."""
        jacobian, residual = self.jacobian(x), self.residual(x)
        free = self._free(x)
        bread = _inverse((jacobian.T * weight) @ jacobian + np.diag(self.prior), free)
        tiles, unknowns = int(self.tile.max()) + 1, int(np.count_nonzero(free[: len(self.names)]))
        if tiles < FEWEST_TILES_PER_UNKNOWN * unknowns:
            chi_square = float(weight @ residual**2) / max(len(residual) - free.sum(), 1)
            return bread * max(chi_square, 1.0), "covariance scaled by residuals"
        scores = np.stack(
            [np.bincount(self.tile, weight * residual * column, minlength=tiles) for column in jacobian.T]
        )
        filling = scores @ scores.T * tiles / (tiles - unknowns) + np.diag(self.prior)
        return bread @ filling @ bread, f"covariance from the scatter of {tiles} patches of ground"

    def bootstrapped(self, x: Array) -> Array:
        """Covariance of fits to patches of ground drawn with replacement, each with calibration factors expected where
        another calibration of the same quality would have put them."""
        rng = np.random.default_rng(self.settings.seed)
        tiles = int(self.tile.max()) + 1
        found, n = [], len(self.names)
        for _ in range(self.settings.bootstrap):
            times = np.bincount(rng.integers(tiles, size=tiles), minlength=tiles).astype(np.float64)
            self.expected[n:] = rng.normal(0, self.settings.calibration_sigma or 0, self.images)
            found.append(self.solve(times[self.tile], x)[0])
        self.expected[n:] = 0
        return np.atleast_2d(np.cov(np.array(found).T))

    def _free(self, x: Array) -> NDArray[np.bool_]:
        """Unknowns that did not run into a limit."""
        span = np.where(np.isfinite(self.high), self.high - self.low, np.abs(x))
        return np.asarray(
            (x - self.low > AT_BOUND * span) & (~np.isfinite(self.high) | (self.high - x > AT_BOUND * span))
        )

    def result(self, x: Array, covariance: Array, method: str) -> PhotometricFit:
        """What was found."""
        n, image = len(self.names), self.pixels.image
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0))
        residual = self.residual(x)
        images = range(len(self.level))
        return PhotometricFit(
            law=self.law.name,
            values=dict(self.values(x)),
            sigma=dict(zip(self.names, sigma[:n].tolist(), strict=True)),
            held=dict(self.held),
            at_bound=tuple(name for name, free in zip(self.names, self._free(x), strict=False) if not free),
            names=self.names,
            covariance=covariance[:n, :n],
            calibration=np.exp(x[n:]) if self.images else np.ones(len(self.level)),
            calibration_sigma=np.exp(x[n:]) * sigma[n:] if self.images else np.zeros(len(self.level)),
            model=self.model(x),
            residual=residual,
            rms=np.array([float(np.sqrt(np.mean(residual[image == i] ** 2))) for i in images]),
            tiles=int(self.tile.max()) + 1,
            method=method,
            absolute=SCALE in self.held or not self.law.scaled,
        )


def _inverse(normal: Array, free: NDArray[np.bool_]) -> Array:
    """Inverse over the free unknowns, 0 elsewhere."""
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inner = (normal / np.outer(scale, scale))[np.ix_(free, free)]
    inverse = np.zeros_like(normal)
    inverse[np.ix_(free, free)] = np.linalg.pinv(inner, rcond=1e-13, hermitian=True)
    return inverse / np.outer(scale, scale)
