"""One linearised least-squares problem: weights of the linear unknowns and a step of the others, robust, with priors
and with the tiles' own unknowns eliminated."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tasks.joint.elimination import eliminated, in_order, residuals
from tasks.joint.thresholds import Thresholds
from tasks.joint.tiles import GAINS, Tiles

Array = NDArray[np.float64]
# Eigenvalue over the largest one, below which a direction has no information: what is left of it is rounding.
UNSEEN = 1e-10
Image = NDArray[np.float32]


@dataclass(frozen=True)
class LinearProblem:
    """image = columns . values + tiles' columns . tiles' values. columns: (n, ny, nx); local: (LOCAL, ny, nx), the
    tiles' columns; prior (n,): inverse variances about expected (n,); local_prior (tiles, LOCAL): about
    zero."""

    image: Image
    columns: Image
    local: Image
    tiles: Tiles
    prior: Array
    expected: Array
    local_prior: Array
    huber: float
    thresholds: Thresholds

    def extended(self, columns: Image, prior: Array) -> "LinearProblem":
        """The problem with more unknowns, which come first: their columns (k, ny, nx), and inverse variances (k,) about
        zero."""
        return replace(
            self,
            columns=np.concatenate([columns, self.columns]),
            prior=np.concatenate([prior, self.prior]),
            expected=np.concatenate([np.zeros(len(prior)), self.expected]),
        )


@dataclass(frozen=True)
class Fit:
    """values (n,): weights of the columns. normal (n, n): its inverse is their covariance, priors included, tiles
    eliminated. information (n, n): the image's part of it. gain (ny, nx): the tiles' factor less one. residual
    (ny, nx): image minus model. weight (ny, nx): inverse variance after down-weighting of outliers. cost: Huber's
    function of the residuals and squares of all priors'. own: (tiles, LOCAL) the tiles' unknowns, own_covariance:
    (tiles, LOCAL, LOCAL), priors included; gain_information: (tiles,) inverse variance of the gain by the image alone.
    by_others: (tiles, LOCAL, n) how much less of them there is for one more of each column."""

    values: Array
    information: Array
    normal: Array
    gain: Image
    residual: Image
    weight: Image
    cost: float
    own: Array
    own_covariance: Array
    gain_information: Array
    by_others: Array

    @property
    def covariance(self) -> Array:
        """(n, n), as if the weights were the truth."""
        return scaled_inverse(self.normal)


def solve_linear(problem: LinearProblem, weight: Image, start: Image | None = None) -> Fit:
    """Robust least squares with weight (ny, nx), inverse variance, 0 where unusable.

    start: residuals (ny, nx) by which the first round is down-weighted.
    """
    order, ends, huber, n = problem.tiles.order, problem.tiles.ends, problem.huber, len(problem.columns)
    columns = in_order(problem.columns, problem.local, problem.image, order, ends)
    base = weight.ravel()[order]
    residual = None if start is None else start.ravel()[order]
    fit: tuple[Array, Array] | None = None
    for _ in range(problem.thresholds.iteration.huber_rounds):
        found = eliminated(columns, base, residual, fit, huber, problem.local_prior)
        whole = found.information + np.diag(problem.prior)
        values = scaled_inverse(whole) @ (found.right + problem.prior * problem.expected)
        by_others = found.by_all[..., :n]
        own = found.by_all[..., n] - by_others @ values
        fit = values, own
    left, shape = residuals(columns, order, base, (values, own), GAINS, huber), problem.image.shape
    cost = left.cost + float(problem.prior @ (values - problem.expected) ** 2)
    cost += float(np.sum(problem.local_prior * own**2))
    return Fit(
        values,
        found.information,
        whole,
        left.gain.reshape(shape),
        left.residual.reshape(shape),
        left.weight.reshape(shape),
        cost,
        own,
        found.inverse,
        found.gain_information,
        by_others,
    )


def scaled_inverse(matrix: Array) -> Array:
    """Inverse of a symmetric (n, n) matrix whose rows have very different units; directions without information
    get none."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    units = np.outer(scale, scale)
    even = matrix / units
    return np.asarray(_plain_inverse(even) / units)


def _plain_inverse(matrix: Array) -> Array:
    """Inverse of a symmetric matrix, a tenth of the time of finding its eigenvalues; where the sizes of both leave open
    whether a direction has no information, `_without_unseen`."""
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return _without_unseen(matrix)
    # The product of the norms is at least the ratio of the eigenvalues.
    if not np.linalg.norm(matrix) * np.linalg.norm(inverse) < 0.1 / UNSEEN:
        return _without_unseen(matrix)
    return np.asarray((inverse + inverse.T) / 2)


def _without_unseen(matrix: Array) -> Array:
    return np.asarray(np.linalg.pinv(matrix, rcond=UNSEEN, hermitian=True))
