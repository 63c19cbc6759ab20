"""Normal equations of a robust fit in one pass over the pixels, compiled by numba: no copies of the design."""

import math

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled, compiled_reordered

# So many pixels at a time that the fastest cache holds their columns.
BLOCK = 256


@compiled_reordered
def accumulate(design, values, weight, solution, limit):  # type: ignore[no-untyped-def]
    """Weighted normal matrix (n, n), right side (n,) and weighted sum of squared residuals.

    design (n, p), values, weight (p,): pixels without weight are passed over. Each weight is lowered by Huber's factor
    for the residual against `solution` (n,) where that exceeds `limit`, in sigmas; an infinite limit keeps all.
    """
    n, pixels = design.shape
    normal = np.zeros((n, n))
    right = np.zeros(n)
    rows, value, w, left = np.zeros((n, BLOCK)), np.zeros(BLOCK), np.zeros(BLOCK), np.zeros(BLOCK)
    weighted = np.zeros(BLOCK)
    chi_square = 0.0
    begin = 0
    while begin < pixels:
        size = min(BLOCK, pixels - begin)
        # What pixels without weight hold, if only NaN, must not count.
        for i in range(size):
            w[i] = max(np.float64(weight[begin + i]), 0.0)
            value[i] = np.float64(values[begin + i]) if w[i] > 0 else 0.0
            left[i] = value[i]
        for j in range(n):
            row, share = rows[j], solution[j]
            for i in range(size):
                row[i] = np.float64(design[j, begin + i]) if w[i] > 0 else 0.0
                left[i] -= share * row[i]
        for i in range(size):
            off = abs(left[i]) * math.sqrt(w[i])
            w[i] = w[i] if off <= limit else w[i] * limit / off
            chi_square += w[i] * left[i] * left[i]
        for j in range(n):
            row = rows[j]
            total = 0.0
            for i in range(size):
                weighted[i] = w[i] * row[i]
                total += weighted[i] * value[i]
            right[j] += total
            for k in range(j + 1):
                other = rows[k]
                total = 0.0
                for i in range(size):
                    total += weighted[i] * other[i]
                normal[j, k] += total
        begin += size
    for j in range(n):
        for k in range(j):
            normal[k, j] = normal[j, k]
    return normal, right, chi_square


@compiled
def _residuals(design, values, weight, solution, stride, out):  # type: ignore[no-untyped-def]
    n, pixels = design.shape
    found = 0
    for i in range(0, pixels, stride):
        if weight[i] <= 0:
            continue
        model = 0.0
        for j in range(n):
            model += design[j, i] * solution[j]
        out[found] = abs(values[i] - model) * np.sqrt(np.float64(weight[i]))
        found += 1
    return found


def residuals(
    design: NDArray[np.float32],
    values: NDArray[np.float32],
    weight: NDArray[np.float32],
    solution: NDArray[np.float64],
    stride: int,
) -> NDArray[np.float64]:
    """Absolute residuals in sigmas of every `stride`-th pixel of positive weight."""
    out = np.empty(values.size // stride + 1)
    return out[: _residuals(design, values, weight, solution, stride, out)]
