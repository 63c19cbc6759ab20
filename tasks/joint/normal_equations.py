"""One linearised least-squares problem: weights of the linear unknowns and a step of the others, robust, with priors
and with the tiles' own unknowns eliminated."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.robust import huber_cost, huber_weight
from tasks.compiled import compiled, compiled_reordered
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
    tiles, n, huber = problem.tiles, len(problem.columns), problem.huber
    order, ends = tiles.order, tiles.ends
    design = np.empty((n + LOCAL, len(order)), np.float32)
    _in_order(problem.columns.reshape(n, -1), order, design[:n])
    _in_order(problem.local.reshape(LOCAL, -1), order, design[n:])
    target, base = problem.image.ravel()[order], weight.ravel()[order]
    now = base if start is None else _robust(base, start.ravel()[order], huber)
    for _ in range(problem.thresholds.iteration.huber_rounds):
        normal, right, cross, inner, inner_right = accumulated(design, n, target, now, ends)
        inner += problem.local_prior[:, :, None] * np.eye(LOCAL)
        # Every tile's unknowns expressed by the others: Schur's complement.
        by_all = np.linalg.solve(inner, np.concatenate([cross, inner_right[..., None]], axis=2))
        by_others, by_data = by_all[..., :n], by_all[..., n]
        eliminated = cross.reshape(-1, n).T @ by_all.reshape(-1, n + 1)
        information = normal - eliminated[:, :n]
        reduced = right - eliminated[:, n]
        whole = information + np.diag(problem.prior)
        values = scaled_inverse(whole) @ (reduced + problem.prior * problem.expected)
        own = by_data - by_others @ values
        model, gain = _evaluate(design, n, GAINS, ends, values, own)
        residual = target - model
        now = _robust(base, residual, huber)
    cost = _cost(residual, base, huber) + float(problem.prior @ (values - problem.expected) ** 2)
    cost += float(np.sum(problem.local_prior * own**2))
    gain_information = inner[:, 0, 0] - problem.local_prior[:, 0]
    gain, residual, now = (_in_place(each, order, problem.image.shape) for each in (gain, residual, now))
    inverse = np.asarray(np.linalg.inv(inner), np.float64)
    return Fit(
        values, information, whole, gain, residual, now, cost, own, inverse, gain_information, np.asarray(by_others)
    )


def _in_place(values: Image, order: NDArray[np.int64], shape: tuple[int, ...]) -> Image:
    """The image (ny, nx) of values in the tiles' order."""
    image = np.empty(len(order), np.float32)
    image[order] = values
    return image.reshape(shape)


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
def _in_order(columns, order, out):  # type: ignore[no-untyped-def]
    for j in range(len(columns)):
        for i in range(len(order)):
            out[j, i] = columns[j, order[i]]


def accumulated(
    design: Image, n: int, target: Image, weight: Image, ends: NDArray[np.int64]
) -> tuple[Array, Array, Array, Array, Array]:
    """Normal matrix (n, n) and right side (n,) of the common unknowns, each tile's with them (tiles, LOCAL, n), and its
    own (tiles, LOCAL, LOCAL), (tiles, LOCAL). design: (n + LOCAL, pixels), in the tiles' order (see `Tiles`)."""
    # So many pixels at a time that the fastest cache holds their columns.
    block = np.zeros((len(design) + 4, 128))
    outside, tiles = _accumulate(design, n, target, weight, ends, block)
    whole = outside + tiles.sum(axis=0)
    local = slice(n, -1)
    normal, inner = np.tril(whole[:n, :n]), np.tril(tiles[:, local, local])
    normal += np.tril(normal, -1).T
    inner += np.swapaxes(np.tril(inner, -1), 1, 2)
    return normal, whole[-1, :n], tiles[:, local, :n], inner, tiles[:, -1, local]


@compiled_reordered
def _accumulate(design, n, target, weight, ends, rows):  # type: ignore[no-untyped-def]
    """Weighted products of all columns, the target as the last one, with each other, below the diagonal: of the pixels
    outside all tiles, and of each tile's. rows: (columns + 3, block), room for a block of pixels, zero."""
    width = len(design) + 1
    outside, tiles = np.zeros((width, width)), np.zeros((len(ends) - 1, width, width))
    block = rows.shape[1]
    weighted = np.empty(block)
    begin = 0
    for t in range(len(ends)):
        products, end = outside if t == 0 else tiles[t - 1], ends[t]
        while begin < end:
            size = min(end - begin, block)
            for j in range(width - 1):
                for i in range(size):
                    rows[j, i] = design[j, begin + i]
            for i in range(size):
                rows[width - 1, i] = target[begin + i]
            for j in range(width):
                if t == 0 and n <= j < width - 1:
                    continue
                for i in range(size):
                    weighted[i] = weight[begin + i] * rows[j, i]
                # Four columns at a time: the weighted one is read a quarter as often.
                for k in range(0, j + 1, 4):
                    a, b, c, d = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
                    to_a, to_b, to_c, to_d = 0.0, 0.0, 0.0, 0.0
                    for i in range(size):
                        to_a += weighted[i] * a[i]
                        to_b += weighted[i] * b[i]
                        to_c += weighted[i] * c[i]
                        to_d += weighted[i] * d[i]
                    products[j, k] += to_a
                    if k + 1 < width:
                        products[j, k + 1] += to_b
                    if k + 2 < width:
                        products[j, k + 2] += to_c
                    if k + 3 < width:
                        products[j, k + 3] += to_d
            begin += size
    return outside, tiles


@compiled_reordered
def _evaluate(design, n, gains, ends, values, own):  # type: ignore[no-untyped-def]
    """Model (p,), and what the tiles' first unknowns, the gains, add to it relative to the first column (p,)."""
    width, pixels = design.shape
    model, gain, factor = np.zeros(pixels, np.float32), np.zeros(pixels, np.float32), np.zeros(pixels)
    total = np.zeros(pixels)
    begin = 0
    for t in range(len(ends)):
        end = ends[t]
        for j in range(width if t > 0 else n):
            share = values[j] if j < n else own[t - 1, j - n]
            for i in range(begin, end):
                total[i] += share * design[j, i]
            if n <= j < n + gains:
                for i in range(begin, end):
                    factor[i] += share * design[j, i]
        for i in range(begin, end):
            model[i] = total[i]
            if t > 0 and design[n, i] != 0:
                gain[i] = factor[i] / design[n, i]
        begin = end
    return model, gain
