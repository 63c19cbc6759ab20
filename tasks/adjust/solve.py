"""A linear-Gaussian solve over many images: constants of cameras, attitude and range bias of sequences, and how far
single images scatter about them.

What image i says of (range, roll, attitude, blur) is z_i = H_i theta + e_i + noise_i. theta: per camera the logarithm
of the focal scale, roll, and logarithm of the blur; per sequence the logarithm of the range bias and a body's turn.
e_i: scatter of the image about what is shared, of unknown variance per kind, zero if the tie holds; found by restricted
maximum likelihood (Patterson and Thompson 1971, Biometrika 58, 545). Images far off weigh less (Student's t).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.adjust.measurement import SHARED, Measurement
from tasks.adjust.sequences import sequences_of
from tasks.adjust.settings import AdjustSettings
from tasks.joint.parameters import ATTITUDE, OFFSET, PSF, RANGE, ROLL

Array = NDArray[np.float64]
KINDS = ("range", "roll", "attitude", "psf")
START = OFFSET.stop
AT_RANGE, AT_ROLL, AT_PSF = RANGE - START, ROLL - START, PSF - START
AT_ATTITUDE = slice(ATTITUDE.start - START, ATTITUDE.stop - START)
KIND_OF = np.array([0, 1, 2, 2, 2, 3])
ROUNDS = 3
# A scatter is believed when it raises the likelihood by this much (5 % of ties that hold would be given up).
SIGNIFICANT = 1.35


@dataclass(frozen=True)
class Adjustment:
    """cameras: names; sequences: positions of their images. theta (3 cameras + 4 sequences,): per camera logarithm of
    the focal scale, roll_deg, logarithm of the blur's factor; then per sequence logarithm of the range bias and a turn
    (3,), degrees. covariance: of theta. scatter (4,): 1-sigma of KINDS. weights (n,) of the images. chi_square,
    degrees: of the images about what they share, without scatter and at full weight; own: the same per image.
    shared, shared_covariance (n, 6), (n, 6, 6): each image's unknowns after the adjustment."""

    cameras: list[str]
    sequences: list[list[int]]
    theta: Array
    covariance: Array
    scatter: Array
    weights: Array
    chi_square: float
    degrees: int
    own: Array
    ranks: NDArray[np.int64]
    shared: Array
    shared_covariance: Array

    def of_camera(self, number: int) -> slice:
        """Places of a camera's constants in theta."""
        return slice(3 * number, 3 * number + 3)

    def of_sequence(self, number: int) -> slice:
        """Places of a sequence's constants in theta."""
        start = 3 * len(self.cameras) + 4 * number
        return slice(start, start + 4)


def adjust(images: Sequence[Measurement], settings: AdjustSettings) -> Adjustment:
    """Solve for everything that `images` share. Raises ValueError without images."""
    if not images:
        raise ValueError("no images to adjust")
    cameras = sorted({image.camera.name for image in images})
    sequences = sequences_of(images, settings.gap_s)
    told = [image.information for image in images]
    problem = _Problem(
        np.array([matrix for matrix, _ in told]),
        np.array([vector for _, vector in told]),
        _designs(images, cameras, sequences),
        _priors(images, cameras, sequences, settings),
    )
    weights, scatter = np.ones(len(images)), np.zeros(len(KINDS))
    for _ in range(ROUNDS):
        scatter = problem.likeliest_scatter(weights, settings)
        solved = problem.solved(scatter, weights)
        own = problem.distances(solved.theta, scatter)
        limit = problem.ranks * settings.robust_sigmas**2
        weights = np.minimum(1.0, np.sqrt(np.maximum(limit, 1e-9) / np.maximum(own, 1e-9)))
    solved = problem.solved(scatter, weights)
    rigid = problem.solved(np.zeros(len(KINDS)), np.ones(len(images)))
    own = problem.distances(rigid.theta, np.zeros(len(KINDS)))
    free = np.count_nonzero(problem.prior == 0)
    shared, spread = problem.images(solved, scatter, weights)
    return Adjustment(
        cameras=cameras,
        sequences=sequences,
        theta=solved.theta,
        covariance=solved.covariance,
        scatter=scatter,
        weights=weights,
        chi_square=float(own.sum() + problem.prior @ rigid.theta**2),
        degrees=int(problem.ranks.sum()) - int(free),
        own=own,
        ranks=problem.ranks,
        shared=shared,
        shared_covariance=spread,
    )


def _designs(images: Sequence[Measurement], cameras: list[str], sequences: list[list[int]]) -> Array:
    """(n, 6, p): a longer focal length makes the disk larger, as a smaller range does."""
    design = np.zeros((len(images), len(SHARED), 3 * len(cameras) + 4 * len(sequences)))
    for number, positions in enumerate(sequences):
        place = 3 * len(cameras) + 4 * number
        design[positions, AT_RANGE, place] = 1
        for axis in range(3):
            design[positions, AT_ATTITUDE.start + axis, place + 1 + axis] = 1
    for i, image in enumerate(images):
        place = 3 * cameras.index(image.camera.name)
        design[i, AT_RANGE, place] = -1
        design[i, AT_ROLL, place + 1] = 1
        design[i, AT_PSF, place + 2] = 1
    return design


def _priors(
    images: Sequence[Measurement], cameras: list[str], sequences: list[list[int]], settings: AdjustSettings
) -> Array:
    """Inverse variances (p,) about zero: every prior counts once, for what is shared, and not once per image."""
    sigmas = [
        sigma
        for name in cameras
        for sigma in (
            settings.focal_relative,
            max(image.sigmas[ROLL] for image in images if image.camera.name == name),
            settings.psf_relative,
        )
    ]
    for positions in sequences:
        turn = max(float(images[i].sigmas[ATTITUDE].max()) for i in positions)
        sigmas += [max(images[i].range_sigma for i in positions), turn, turn, turn]
    return np.asarray(1 / np.array(sigmas) ** 2)


@dataclass(frozen=True)
class _Solved:
    theta: Array
    covariance: Array
    log_likelihood: float


@dataclass(frozen=True)
class _Problem:
    """matrix (n, 6, 6), vector (n, 6): information of each image; design (n, 6, p); prior (p,) inverse variances."""

    matrix: Array
    vector: Array
    design: Array
    prior: Array

    @property
    def ranks(self) -> NDArray[np.int64]:
        """How many directions each image tells of (n,)."""
        return np.array([np.linalg.matrix_rank(scaled(m), tol=1e-8, hermitian=True) for m in self.matrix])

    def told(self, scatter: Array, weights: Array) -> tuple[Array, Array, Array]:
        """Information on what is shared (n, 6, 6) and (n, 6), the scatter being part of the noise; and the matrix T (I
        + N T)^-1 (n, 6, 6), the covariance of an image's own part."""
        matrix, vector = weights[:, None, None] * self.matrix, weights[:, None] * self.vector
        root = scatter[KIND_OF]
        # With T = S S: (I + S N S) is symmetric and sound for any S, also zero.
        core = np.linalg.inv(np.eye(len(SHARED)) + root[:, None] * matrix * root)
        own = root[:, None] * core * root
        return matrix - matrix @ own @ matrix, vector - np.einsum("nij,njk,nk->ni", matrix, own, vector), own

    def solved(self, scatter: Array, weights: Array) -> _Solved:
        """theta by generalised least squares, and the restricted likelihood of the scatter."""
        matrix, vector, own = self.told(scatter, weights)
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
        return _Solved(theta, covariance, float(-0.5 * (misfit - explained - right @ theta)))

    def likeliest_scatter(self, weights: Array, settings: AdjustSettings) -> Array:
        """1-sigma (4,) of KINDS; zero where the images do not speak against the tie."""
        limits = np.array([settings.limit_range, settings.limit_deg, settings.limit_deg, settings.limit_psf])
        allowed = np.ones(len(KINDS), bool)
        best, likelihood = self._likeliest(weights, limits, allowed)
        while allowed.any():
            trials = []
            for kind in np.flatnonzero(allowed):
                fewer = allowed & (np.arange(len(KINDS)) != kind)
                trials.append((*self._likeliest(weights, limits, fewer), fewer))
            scatter, reached, fewer = max(trials, key=lambda trial: trial[1])
            if reached < likelihood - SIGNIFICANT:
                break
            best, likelihood, allowed = scatter, reached, fewer
        return best

    def _likeliest(self, weights: Array, limits: Array, allowed: NDArray[np.bool_]) -> tuple[Array, float]:
        """The scatter, zero where not allowed, of the largest likelihood, and that."""
        from scipy.optimize import minimize

        typical = np.array([self._typical(kind) for kind in range(len(KINDS))])
        if not allowed.any():
            return np.zeros(len(KINDS)), self.solved(np.zeros(len(KINDS)), weights).log_likelihood
        found = minimize(
            lambda part: -self.solved(part * typical, weights).log_likelihood,
            1.0 * allowed,
            method="L-BFGS-B",
            bounds=[
                (0, limit / unit if free else 0) for limit, unit, free in zip(limits, typical, allowed, strict=True)
            ],
            options={"maxiter": 40},
        )
        return found.x * typical, -float(found.fun)

    def _typical(self, kind: int) -> float:
        """Error of an image's unknown of this kind when the others are known."""
        told = self.matrix[:, np.arange(len(SHARED)), np.arange(len(SHARED))][:, kind == KIND_OF]
        return float(np.median(1 / np.sqrt(np.maximum(told, 1e-9)))) if (told > 0).any() else 1.0

    def distances(self, theta: Array, scatter: Array) -> Array:
        """Squared distance (n,) of each image from what it shares, in its own sigmas and the scatter's."""
        matrix, vector, _ = self.told(scatter, np.ones(len(self.matrix)))
        expected = self.design @ theta
        found = np.empty(len(matrix))
        for i, (told, right) in enumerate(zip(matrix, vector, strict=True)):
            away = right - told @ expected[i]
            unit = 1 / np.sqrt(np.maximum(np.diag(told), 1e-300))
            inverse = np.linalg.pinv(told * np.outer(unit, unit), rcond=1e-9, hermitian=True)
            found[i] = (away * unit) @ inverse @ (away * unit)
        return found

    def images(self, solved: _Solved, scatter: Array, weights: Array) -> tuple[Array, Array]:
        """Each image's unknowns (n, 6) and their covariance (n, 6, 6): what is shared, and its own part."""
        _, _, own = self.told(scatter, weights)
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
