"""Least squares on intensities: offset, brightness of each basis image and background, solved together."""

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from tasks.point.registration.base import Match, Shift
from tasks.simulate import Simulation

MAX_ITERATIONS = 30
CONVERGED_PX = 1e-3
HUBER = 3.0


def moved(image: NDArray[np.float32], offset_px: NDArray[np.float64]) -> NDArray[np.float32]:
    """`image` (ny, nx) displaced by (dx, dy) pixels, cubic, edges replicated."""
    import cv2

    transform = np.array([[1, 0, offset_px[0]], [0, 1, offset_px[1]]], dtype=np.float64)
    ny, nx = image.shape
    return cv2.warpAffine(image, transform, (nx, ny), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def background_columns(shape: tuple[int, int]) -> list[NDArray[np.float64]]:
    """A constant background (ny, nx)."""
    return [np.ones(shape)]


def fit_brightness(match: Match, bases: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Robust weighted fit of image = sum_k c_k basis_k + background.

    Returns the model image (ny, nx) and the coefficients (k + background terms). Raises FailedError when nothing of
    the target is on usable pixels.
    """
    columns = np.stack([*(b.astype(np.float64) for b in bases), *background_columns(match.image.shape)])
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


def register_intensity(match: Match) -> Shift:
    """Offset by Gauss-Newton steps on mean squares, where each step also solves the brightness of every basis image
    and the background; coarse to fine, so that it starts from some pixels away."""
    offset = np.zeros(2)
    iterations = 0
    covariance = np.full((2, 2), np.nan)
    for blur_px in (4.0, 1.5, 0.0):
        image, bases = blurred(match, blur_px)
        for _ in range(MAX_ITERATIONS):
            iterations += 1
            shifted = np.stack([moved(b, offset) for b in bases])
            step, covariance = gauss_newton_step(image, match.weight, shifted)
            limit = 2.0 + 2 * blur_px
            offset = offset + step * min(1.0, limit / max(float(np.hypot(*step)), 1e-12))
            if np.abs(step).max() < max(CONVERGED_PX, 0.02 * blur_px):
                break
    shifted = np.stack([moved(b, offset) for b in match.simulation.bases])
    model, _ = fit_brightness(match, shifted)
    return Shift(offset, covariance, iterations, correlation(match.image, model, match.usable))


def gauss_newton_step(
    image: NDArray[np.float32], weight: NDArray[np.float32], bases: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """One linearised step: (dx, dy) by which the simulated target must move, and its covariance (2, 2)."""
    columns = [*(b.astype(np.float64) for b in bases), *background_columns(image.shape)]
    coefficients, _, _ = robust_least_squares(np.stack(columns), image, weight)
    model = np.tensordot(coefficients, np.stack(columns), 1)
    d_row, d_column = np.gradient(model)
    solution, covariance, _ = robust_least_squares(np.stack([*columns, -d_column, -d_row]), image, weight)
    return solution[-2:], covariance[-2:, -2:]


def blurred(match: Match, sigma_px: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Image and bases blurred alike; the image's unusable pixels do not bleed into usable ones."""
    if sigma_px == 0:
        return match.image, match.simulation.bases
    import cv2

    def blur(a: NDArray[np.float32]) -> NDArray[np.float32]:
        return cv2.GaussianBlur(a, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE)

    usable = match.usable.astype(np.float32)
    image = np.divide(blur(match.image * usable), blur(usable), out=match.image.copy(), where=blur(usable) > 0.05)
    return image, np.stack([blur(b) for b in match.simulation.bases])


def correlation(a: NDArray, b: NDArray, usable: NDArray[np.bool_]) -> float:
    """Pearson correlation over usable pixels; 0 when one of them is constant."""
    x, y = a[usable].astype(np.float64), b[usable].astype(np.float64)
    if x.size < 2:
        return 0.0
    x, y = x - x.mean(), y - y.mean()
    norm = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / norm if norm > 0 else 0.0


def simulated_like(match: Match, simulation: Simulation | None = None) -> NDArray[np.float64]:
    """The simulation in the image's units: weights of its bases and background fitted to the image."""
    model, _ = fit_brightness(match, (simulation or match.simulation).bases)
    return model
