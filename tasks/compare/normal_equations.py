"""Normal equations of a robust fit in one pass over the pixels, compiled by numba: no copies of the design."""

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled


@compiled
def accumulate(design, values, weight, solution, limit):  # type: ignore[no-untyped-def]
    """Weighted normal matrix (n, n), right side (n,) and weighted sum of squared residuals.

    design (n, p), values, weight (p,): pixels without weight are passed over. Each weight is lowered by Huber's factor
    for the residual against `solution` (n,) where that exceeds `limit`, in sigmas; an infinite limit keeps all.
    """
    n, pixels = design.shape
    normal = np.zeros((n, n))
    right = np.zeros(n)
    row = np.zeros(n)
    chi_square = 0.0
    for i in range(pixels):
        base = np.float64(weight[i])
        if base <= 0:
            continue
        model = 0.0
        for j in range(n):
            row[j] = design[j, i]
            model += row[j] * solution[j]
        residual = values[i] - model
        size = abs(residual) * np.sqrt(base)
        w = base if size <= limit else base * limit / size
        chi_square += w * residual * residual
        for j in range(n):
            wr = w * row[j]
            right[j] += wr * values[i]
            for k in range(j + 1):
                normal[j, k] += wr * row[k]
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
