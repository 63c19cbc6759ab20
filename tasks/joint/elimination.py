"""Weighted products of all columns in one pass over the pixels, and each tile's own unknowns eliminated from them
(Schur's complement), compiled by numba.

Pixels are taken in blocks that the fastest cache holds.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catalog.robust import LEAST_SIZE
from tasks.compiled import compiled_reordered

Array = NDArray[np.float64]
Image = NDArray[np.float32]
BLOCK = 256
LEAST, ONE = np.float32(LEAST_SIZE), np.float32(1)


class Eliminated(NamedTuple):
    """information (n, n) and right (n,) of the common unknowns, the tiles' eliminated; by_all (tiles, local, n + 1):
    each tile's unknowns by those, the last by the image; inverse (tiles, local, local) of their own normal matrix,
    priors included; gain_information (tiles,): the first one's, without its prior."""

    information: Array
    right: Array
    by_all: Array
    inverse: Array
    gain_information: Array


class Columns(NamedTuple):
    """design (n + local, pixels), the first n common, and target (pixels,), one tile's pixels after the other, those
    outside all first; ends: where the pixels outside all and those of each tile end (1 + tiles,)."""

    design: Image
    n: int
    target: Image
    ends: NDArray[np.int64]


def in_order(columns: Image, local: Image, image: Image, order: NDArray[np.int64], ends: NDArray[np.int64]) -> Columns:
    """Columns (n, ny, nx), the tiles' (local, ny, nx) and image (ny, nx) with their pixels in `order`."""
    n, count, pixels = len(columns), len(local), len(order)
    design = np.empty((n + count, pixels), np.float32)
    _gather(columns.reshape(n, -1), order, design[:n])
    _gather(local.reshape(count, -1), order, design[n:])
    return Columns(design, n, image.ravel()[order], ends)


def eliminated(
    columns: Columns, base: Image, residual: Image | None, fit: tuple[Array, Array] | None, huber: float, prior: Array
) -> Eliminated:
    """Normal equations with weights `base` (pixels,), each lowered by Huber's factor for its residual: that of the
    values (n,) and the tiles' values (tiles, local) of `fit`, else as given (pixels,), else none. prior: (tiles, local)
    inverse variances of the tiles' unknowns about zero."""
    n, (tiles, count) = columns.n, prior.shape
    values, own = fit or (np.zeros(0), np.zeros((0, 0)))
    products = np.zeros((n + 1, n + 1))
    by_all, inverse = np.empty((tiles, count, n + 1)), np.empty((tiles, count, count))
    gain_information = np.empty(tiles)
    # Room for rows that fill up the last group of four columns, and the last pair.
    rows = np.zeros((len(columns.design) + 8, BLOCK))
    given = np.zeros(0, np.float32) if residual is None else residual
    out = (products, by_all, inverse, gain_information)
    _eliminate(columns.design, n, columns.target, base, given, columns.ends, values, own, huber, prior, rows, out)
    return Eliminated(products[:n, :n], products[n, :n], by_all, inverse, gain_information)


@compiled_reordered
def _gather(columns, order, out):  # type: ignore[no-untyped-def]
    for j in range(len(columns)):
        for i in range(len(order)):
            out[j, i] = columns[j, order[i]]


@compiled_reordered
def _eliminate(design, n, target, base, given, ends, values, own, huber, prior, rows, out):  # type: ignore[no-untyped-def]
    """See `eliminated`; values without elements: the residuals are the `given` ones."""
    common, by_all, inverse, gain_information = out
    local = len(design) - n
    width, block = n + local + 1, rows.shape[1]
    sums = np.zeros((width + 5, width + 5))
    weight, weighted, total = np.zeros(block, np.float32), np.zeros((2, block)), np.zeros(block)
    zero = 0.0
    begin = 0
    for t in range(len(ends)):
        end = ends[t]
        sums[:] = 0
        # Outside the tiles their columns do not count: the target comes right after the common ones.
        used = n if t == 0 else n + local
        while begin < end:
            size = min(end - begin, block)
            # Views whose indices count from 0: of others the compiler would have to ask whether they are negative.
            sure = base[begin : begin + size]
            for j in range(used):
                row, column = rows[j], design[j, begin : begin + size]
                for i in range(size):
                    row[i] = column[i]
            row, column = rows[used], target[begin : begin + size]
            for i in range(size):
                row[i] = column[i]
            if len(values) > 0:
                total[:size] = 0
                for j in range(used):
                    share, row = values[j] if j < n else own[t - 1, j - n], rows[j]
                    for i in range(size):
                        total[i] += share * row[i]
                row = rows[used]
                for i in range(size):
                    left = np.float32(row[i]) - np.float32(total[i])
                    off = max(abs(left) * math.sqrt(sure[i]), LEAST)
                    weight[i] = sure[i] * min(ONE, np.float32(huber) / off)
            elif len(given) > 0:
                column = given[begin : begin + size]
                for i in range(size):
                    off = max(abs(column[i]) * math.sqrt(sure[i]), LEAST)
                    weight[i] = sure[i] * min(ONE, np.float32(huber) / off)
            else:
                for i in range(size):
                    weight[i] = sure[i]
            # Two rows of products by four columns at a time: each is read from the cache a half or a quarter as often.
            for j in range(0, used + 1, 2):
                first, second = rows[j], rows[j + 1]
                p, q = weighted[0], weighted[1]
                for i in range(size):
                    p[i] = weight[i] * first[i]
                    q[i] = weight[i] * second[i]
                for k in range(0, j + 2, 4):
                    a, b, c, d = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
                    pa, pb, pc, pd, qa, qb, qc, qd = zero, zero, zero, zero, zero, zero, zero, zero
                    for i in range(size):
                        pa += p[i] * a[i]
                        pb += p[i] * b[i]
                        pc += p[i] * c[i]
                        pd += p[i] * d[i]
                        qa += q[i] * a[i]
                        qb += q[i] * b[i]
                        qc += q[i] * c[i]
                        qd += q[i] * d[i]
                    sums[j, k] += pa
                    sums[j, k + 1] += pb
                    sums[j, k + 2] += pc
                    sums[j, k + 3] += pd
                    sums[j + 1, k] += qa
                    sums[j + 1, k + 1] += qb
                    sums[j + 1, k + 2] += qc
                    sums[j + 1, k + 3] += qd
            begin += size
        for j in range(n):
            for k in range(j + 1):
                common[j, k] += sums[j, k]
            common[n, j] += sums[used, j]
        if t > 0:
            for j in range(local):
                for k in range(n):
                    by_all[t - 1, j, k] = sums[n + j, k]
                by_all[t - 1, j, n] = sums[used, n + j]
            gain_information[t - 1] = sums[n, n]
            _eliminate_tile(sums[n:used, n:used], prior[t - 1], by_all[t - 1], inverse[t - 1], common)
    for j in range(n):
        for k in range(j):
            common[k, j] = common[j, k]


@compiled_reordered
def _eliminate_tile(normal, prior, by_all, inverse, common):  # type: ignore[no-untyped-def]
    """Solve a tile's own equations, whose matrix has its lower half filled, for all right sides `by_all` (local, n + 1)
    in place, and take their part away from the common products (n + 1, n + 1), below the diagonal."""
    local, sides = by_all.shape
    n = sides - 1
    factor = np.zeros((local, local))
    # Cholesky's factor.
    for j in range(local):
        for k in range(j + 1):
            value = normal[j, k] + (prior[j] if j == k else 0.0)
            for m in range(k):
                value -= factor[j, m] * factor[k, m]
            factor[j, k] = math.sqrt(max(value, 1e-300)) if j == k else value / factor[k, k]
    # With L of L L' = normal: the halfway solutions L^-1 b give the products that are taken away.
    for j in range(local):
        for k in range(sides):
            value = by_all[j, k]
            for m in range(j):
                value -= factor[j, m] * by_all[m, k]
            by_all[j, k] = value / factor[j, j]
    for m in range(local):
        for j in range(n):
            share = by_all[m, j]
            for k in range(j + 1):
                common[j, k] -= share * by_all[m, k]
            common[n, j] -= share * by_all[m, n]
    for j in range(local - 1, -1, -1):
        for k in range(sides):
            value = by_all[j, k]
            for m in range(j + 1, local):
                value -= factor[m, j] * by_all[m, k]
            by_all[j, k] = value / factor[j, j]
    half = np.zeros((local, local))
    for j in range(local):
        for k in range(j + 1):
            value = 1.0 if j == k else 0.0
            for m in range(k, j):
                value -= factor[j, m] * half[m, k]
            half[j, k] = value / factor[j, j]
    for j in range(local):
        for k in range(local):
            value = 0.0
            for m in range(max(j, k), local):
                value += half[m, j] * half[m, k]
            inverse[j, k] = value


class Residuals(NamedTuple):
    """Images (pixels,) of `residuals`, and Huber's cost."""

    gain: Image
    residual: Image
    weight: Image
    cost: float


def residuals(
    columns: Columns,
    order: NDArray[np.int64],
    base: Image,
    fit: tuple[Array, Array],
    gains: int,
    huber: float,
) -> Residuals:
    """What the values (n,) and the tiles' values (tiles, local) of `fit` leave of the image, with the weights lowered
    for that; and what the first `gains` of the tiles' add relative to the first of their columns."""
    values, own = fit
    gain, residual, weight = (np.zeros(len(order), np.float32) for _ in range(3))
    out = (gain, residual, weight)
    cost = _evaluate(
        columns.design, columns.n, gains, columns.target, base, columns.ends, order, values, own, huber, out
    )
    return Residuals(gain, residual, weight, float(cost))


@compiled_reordered
def _evaluate(design, n, gains, target, base, ends, order, values, own, huber, out):  # type: ignore[no-untyped-def]
    gain, residual, weight = out
    width = len(design)
    total, factor = np.zeros(BLOCK), np.zeros(BLOCK)
    cost, limit, begin = 0.0, np.float32(huber), 0
    for t in range(len(ends)):
        end = ends[t]
        while begin < end:
            size = min(end - begin, BLOCK)
            total[:size] = 0
            factor[:size] = 0
            for j in range(width if t > 0 else n):
                share = values[j] if j < n else own[t - 1, j - n]
                column = design[j, begin : begin + size]
                for i in range(size):
                    total[i] += share * column[i]
                if n <= j < n + gains:
                    for i in range(size):
                        factor[i] += share * column[i]
            seen, sure, first = (
                target[begin : begin + size],
                base[begin : begin + size],
                design[n, begin : begin + size],
            )
            places = order[begin : begin + size]
            for i in range(size):
                left = seen[i] - np.float32(total[i])
                at = places[i]
                size_of = abs(left) * math.sqrt(sure[i])
                residual[at] = left
                weight[at] = sure[i] * min(ONE, limit / max(size_of, LEAST))
                cost += size_of * size_of if size_of <= limit else limit * (2 * size_of - limit)
                if t > 0 and first[i] != 0:
                    gain[at] = factor[i] / first[i]
            begin += size
    return cost
