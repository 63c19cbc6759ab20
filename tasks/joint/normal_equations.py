"""One linearised least-squares problem: weights of the linear unknowns and a step of the others, robust, with priors
and with the tiles' own unknowns eliminated."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.robust import huber_cost, huber_weight
from tasks.compiled import compiled
from tasks.joint.thresholds import Thresholds
from tasks.joint.tiles import GAINS, LOCAL, Tiles

Array = NDArray[np.float64]
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
    shape = problem.image.shape
    n = len(problem.columns)
    design = np.ascontiguousarray(np.concatenate([problem.columns, problem.local]).reshape(n + LOCAL, -1).T, np.float32)
    target, base = problem.image.ravel(), np.ascontiguousarray(weight.ravel(), np.float32)
    label = problem.tiles.label.ravel()
    now = base if start is None else _robust(base, start.ravel(), problem.huber)
    for _ in range(problem.thresholds.iteration.huber_rounds):
        normal, right, cross, inner, inner_right = _accumulate(design, LOCAL, target, now, label, problem.tiles.count)
        inner += problem.local_prior[:, :, None] * np.eye(LOCAL)
        # Every tile's unknowns expressed by the others: Schur's complement.
        by_others = np.linalg.solve(inner, cross)
        by_data = np.linalg.solve(inner, inner_right[..., None])[..., 0]
        information = normal - np.einsum("tln,tlm->nm", cross, by_others)
        reduced = right - np.einsum("tln,tl->n", cross, by_data)
        whole = information + np.diag(problem.prior)
        values = scaled_inverse(whole) @ (reduced + problem.prior * problem.expected)
        own = by_data - by_others @ values
        model, gain = _evaluate(design, LOCAL, GAINS, label, values, own)
        residual = target - model
        now = _robust(base, residual, problem.huber)
    cost = _cost(residual, base, problem.huber) + float(problem.prior @ (values - problem.expected) ** 2)
    cost += float(np.sum(problem.local_prior * own**2))
    gain_information = inner[:, 0, 0] - problem.local_prior[:, 0]
    gains = (gain.reshape(shape), residual.reshape(shape), now.reshape(shape))
    return Fit(values, information, whole, *gains, cost, own, np.linalg.inv(inner), gain_information, by_others)


def scaled_inverse(matrix: Array) -> Array:
    """Inverse of a symmetric (n, n) matrix whose rows have very different units; directions without information
    get none."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix / np.outer(scale, scale), rcond=1e-10, hermitian=True)
    return np.asarray(inverse / np.outer(scale, scale))


def _cost(residual: Image, weight: Image, huber: float) -> float:
    size = np.abs(residual) * np.sqrt(weight)
    return float(np.sum(huber_cost(size, huber), dtype=np.float64))


def _robust(weight: Image, residual: Image, huber: float) -> Image:
    size = np.abs(residual) * np.sqrt(weight)
    return np.asarray(weight * huber_weight(size, huber))


@compiled
def _accumulate(design, local, target, weight, label, tiles):  # type: ignore[no-untyped-def]
    """Normal matrix and right side of the common unknowns, each tile's with them, and its own."""
    pixels, width = design.shape
    n = width - local
    normal, right = np.zeros((n, n)), np.zeros(n)
    cross, inner, inner_right = np.zeros((tiles, local, n)), np.zeros((tiles, local, local)), np.zeros((tiles, local))
    row = np.zeros(width)
    for i in range(pixels):
        w = np.float64(weight[i])
        if w <= 0:
            continue
        for j in range(width):
            row[j] = design[i, j]
        y = np.float64(target[i])
        for j in range(n):
            wr = w * row[j]
            right[j] += wr * y
            for k in range(j + 1):
                normal[j, k] += wr * row[k]
        t = label[i]
        if t < 0:
            continue
        for a in range(local):
            wr = w * row[n + a]
            inner_right[t, a] += wr * y
            for k in range(n):
                cross[t, a, k] += wr * row[k]
            for b in range(local):
                inner[t, a, b] += wr * row[n + b]
    for j in range(n):
        for k in range(j):
            normal[k, j] = normal[j, k]
    return normal, right, cross, inner, inner_right


@compiled
def _evaluate(design, local, gains, label, values, own):  # type: ignore[no-untyped-def]
    """Model (p,), and what the tiles' first unknowns, the gains, add to it relative to the first column (p,)."""
    pixels, width = design.shape
    n = width - local
    model, gain = np.zeros(pixels, np.float32), np.zeros(pixels, np.float32)
    for i in range(pixels):
        total = 0.0
        for j in range(n):
            total += design[i, j] * values[j]
        t = label[i]
        if t >= 0:
            added, factor = 0.0, 0.0
            for a in range(local):
                added += design[i, n + a] * own[t, a]
                if a < gains:
                    factor += design[i, n + a] * own[t, a]
            total += added
            if design[i, n] != 0:
                gain[i] = factor / design[i, n]
        model[i] = total
    return model, gain
