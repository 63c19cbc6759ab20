"""How likely a scatter of images about what they share is, and what they share for a given one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.adjust.measurement import SHARED
from tasks.adjust.settings import AdjustSettings

Array = NDArray[np.float64]
KINDS = ("range", "roll", "attitude", "psf")
KIND_OF = np.array([0, 1, 2, 2, 2, 3])
# A scatter is accepted when it raises the likelihood by this much (5 % of ties that hold would be given up).
SIGNIFICANT = 1.35


@dataclass(frozen=True)
class Solved:
    """theta (p,), its covariance (p, p), and the restricted likelihood of the scatter."""

    theta: Array
    covariance: Array
    log_likelihood: float


@dataclass(frozen=True)
class Problem:
    """matrix (n, 6, 6), vector (n, 6): information of each image; design (n, 6, p); prior (p,) inverse variances."""

    matrix: Array
    vector: Array
    design: Array
    prior: Array

    @property
    def ranks(self) -> NDArray[np.int64]:
        """How many directions each image tells of (n,)."""
        return np.array([np.linalg.matrix_rank(scaled(m), tol=1e-8, hermitian=True) for m in self.matrix])

    @property
    def counts(self) -> NDArray[np.int64]:
        """Number of measurements of each kind (4,)."""
        informed = np.diagonal(self.matrix, axis1=1, axis2=2) > 0
        return np.array([np.count_nonzero(informed[:, kind == KIND_OF]) for kind in range(len(KINDS))])

    def chi_square_of(self, kind: int, settings: AdjustSettings) -> float:
        """Of the images about what they share of one kind, when they may differ in all others."""
        scatter = limits_of(settings)
        scatter[kind] = 0
        everybody = np.ones(len(self.matrix))
        return float(self.distances(self.solved(scatter, everybody).theta, scatter).sum())

    def marginal_information(self, scatter: Array, weights: Array) -> tuple[Array, Array, Array]:
        """Information on what is shared (n, 6, 6) and (n, 6), the scatter being part of the noise; and the matrix T (I
        + N T)^-1 (n, 6, 6), the covariance of an image's own part."""
        matrix, vector = weights[:, None, None] * self.matrix, weights[:, None] * self.vector
        root = scatter[KIND_OF]
        # With T = S S: (I + S N S) is symmetric and sound for any S, also zero.
        core = np.linalg.inv(np.eye(len(SHARED)) + root[:, None] * matrix * root)
        own = root[:, None] * core * root
        return matrix - matrix @ own @ matrix, vector - np.einsum("nij,njk,nk->ni", matrix, own, vector), own

    def solved(self, scatter: Array, weights: Array) -> Solved:
        """theta by generalised least squares, and the restricted likelihood of the scatter."""
        matrix, vector, own = self.marginal_information(scatter, weights)
        flat = self.design.reshape(-1, len(self.prior))
        normal = flat.T @ (matrix @ self.design).reshape(flat.shape) + np.diag(self.prior)
        right = flat.T @ vector.ravel()
        scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
        inner = normal * np.outer(scale, scale)
        covariance = np.linalg.pinv(inner, rcond=1e-12, hermitian=True) * np.outer(scale, scale)
        theta = covariance @ right
        root = scatter[KIND_OF]
        whole = np.eye(len(SHARED)) + root[:, None] * (weights[:, None, None] * self.matrix) * root
        explained = np.einsum("ni,nij,nj->", weights[:, None] * self.vector, own, weights[:, None] * self.vector)
        misfit = np.linalg.slogdet(whole)[1].sum() + np.linalg.slogdet(inner)[1] - 2 * np.log(scale).sum()
        return Solved(theta, covariance, float(-0.5 * (misfit - explained - right @ theta)))

    def weights(self, theta: Array, scatter: Array, robust_sigmas: float) -> Array:
        """Of the images (n,): less than 1 for those further from what they share than is usual among them."""
        own = self.distances(theta, scatter) / np.maximum(self.ranks, 1)
        limit = robust_sigmas**2 * max(float(np.median(own)), 1.0)
        return np.minimum(1.0, limit / np.maximum(own, 1e-9))

    def likeliest_scatter(self, weights: Array, start: Array, settings: AdjustSettings, last: bool = True) -> Array:
        """1-sigma (4,) of KINDS, `start` being near; the last time zero where images do not speak against the tie."""
        limits = limits_of(settings)
        allowed = np.ones(len(KINDS), bool)
        best, likelihood = self._likeliest(weights, start, limits, allowed)
        while last and allowed.any():
            trials = []
            for kind in np.flatnonzero(allowed):
                fewer = allowed & (np.arange(len(KINDS)) != kind)
                trials.append((*self._likeliest(weights, best, limits, fewer), fewer))
            scatter, reached, fewer = max(trials, key=lambda trial: trial[1])
            if reached < likelihood - SIGNIFICANT:
                break
            best, likelihood, allowed = scatter, reached, fewer
        return best

    def _likeliest(
        self, weights: Array, start: Array, limits: Array, allowed: NDArray[np.bool_]
    ) -> tuple[Array, float]:
        """The scatter, zero where not allowed, of the largest likelihood, and that."""
        from scipy.optimize import minimize

        typical = np.array([self._typical(kind) for kind in range(len(KINDS))])
        if not allowed.any():
            return np.zeros(len(KINDS)), self.solved(np.zeros(len(KINDS)), weights).log_likelihood
        found = minimize(
            lambda part: -self.solved(part * typical, weights).log_likelihood,
            np.where(allowed, np.maximum(start / typical, 0.5), 0.0),
            method="L-BFGS-B",
            bounds=[
                (0, limit / unit if free else 0) for limit, unit, free in zip(limits, typical, allowed, strict=True)
            ],
            options={"maxiter": 25, "ftol": 1e-6},
        )
        return found.x * typical, -float(found.fun)

    def _typical(self, kind: int) -> float:
        """Error of an image's unknown of this kind when the others are known."""
        information = self.matrix[:, np.arange(len(SHARED)), np.arange(len(SHARED))][:, kind == KIND_OF]
        return float(np.median(1 / np.sqrt(np.maximum(information, 1e-9)))) if (information > 0).any() else 1.0

    def distances(self, theta: Array, scatter: Array) -> Array:
        """Squared distance (n,) of each image from what it shares, in its own sigmas and the scatter's."""
        matrix, vector, _ = self.marginal_information(scatter, np.ones(len(self.matrix)))
        expected = self.design @ theta
        found = np.empty(len(matrix))
        for i, (information, right) in enumerate(zip(matrix, vector, strict=True)):
            away = right - information @ expected[i]
            unit = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
            inverse = np.linalg.pinv(information * np.outer(unit, unit), rcond=1e-9, hermitian=True)
            found[i] = (away * unit) @ inverse @ (away * unit)
        return found

    def images(self, solved: Solved, scatter: Array, weights: Array) -> tuple[Array, Array]:
        """Each image's unknowns (n, 6) and their covariance (n, 6, 6): what is shared, and its own part."""
        _, _, own = self.marginal_information(scatter, weights)
        matrix, vector = weights[:, None, None] * self.matrix, weights[:, None] * self.vector
        expected = self.design @ solved.theta
        part = np.einsum("nij,nj->ni", own, vector - np.einsum("nij,nj->ni", matrix, expected))
        # d(unknowns) / d(theta): the image's own part gives way.
        give = np.eye(len(SHARED)) - own @ matrix
        lever = give @ self.design
        spread = own + np.einsum("nip,pq,njq->nij", lever, solved.covariance, lever)
        return expected + part, spread


def scaled(matrix: Array) -> Array:
    """A symmetric matrix in units of its own diagonal."""
    unit = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return np.asarray(matrix * np.outer(unit, unit))


def limits_of(settings: AdjustSettings) -> Array:
    """Largest scatter (4,) of each of KINDS."""
    return np.array([settings.limit_range, settings.limit_deg, settings.limit_deg, settings.limit_psf])
