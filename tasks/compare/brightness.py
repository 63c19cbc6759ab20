"""The brightness of a simulation: weights of its basis images and a background, fitted to the image."""

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from tasks.compare.match import Match

HUBER = 3.0


def brightness_columns(bases: NDArray[np.float32]) -> NDArray[np.float64]:
    """The linear unknowns' images (k + 1, ny, nx): every basis, and a constant background."""
    return np.concatenate([bases, np.ones((1, *bases.shape[1:]))]).astype(np.float64)


def fit_brightness(match: Match, bases: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Robust weighted fit of image = sum_k c_k basis_k + background.

    Returns the model image (ny, nx) and the coefficients (k + background terms). Raises FailedError when nothing of
    the target is on usable pixels.
    """
    columns = brightness_columns(bases)
    coefficients, _, _ = robust_least_squares(columns, match.image, match.weight)
    return np.tensordot(coefficients, columns, 1), coefficients


def robust_least_squares(
    columns: NDArray[np.float64], image: NDArray[np.float32], weight: NDArray[np.float32], rounds: int = 3
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Solve image = sum_j p_j columns_j over pixels of positive weight, down-weighting outliers (Huber).

    columns (n, ny, nx). Returns p (n,), its covariance (n, n) scaled by the residuals, and the reduced chi square.
    """
    inside = weight > 0
    design = columns[:, inside]
    values = image[inside].astype(np.float64)
    if values.size <= len(design):
        raise FailedError("no-usable-pixels", "no usable pixels lie under the simulated target.")
    scale = np.sqrt(np.einsum("ij,ij->i", design, design))
    scale[scale == 0] = 1.0
    design = design / scale[:, None]
    base = weight[inside].astype(np.float64)
    w = base
    for _ in range(rounds):
        weighted = design * w
        normal = weighted @ design.T
        solution = np.linalg.pinv(normal, rcond=1e-13, hermitian=True) @ (weighted @ values)
        residual = np.abs(values - solution @ design) * np.sqrt(base)
        sigma = max(1.4826 * float(np.median(residual)), 1e-12)
        w = base * np.minimum(1.0, HUBER * sigma / np.maximum(residual, 1e-12))
    chi_square = float((w / base * residual**2).sum() / (values.size - len(design)))
    covariance = np.linalg.pinv(normal, rcond=1e-13, hermitian=True) * chi_square / np.outer(scale, scale)
    return solution / scale, covariance, chi_square


def correlation(a: NDArray, b: NDArray, usable: NDArray[np.bool_]) -> float:
    """Pearson correlation over usable pixels; 0 when one of them is constant."""
    x, y = a[usable].astype(np.float64), b[usable].astype(np.float64)
    if x.size < 2:
        return 0.0
    x, y = x - x.mean(), y - y.mean()
    norm = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / norm if norm > 0 else 0.0
