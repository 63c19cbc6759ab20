"""The brightness of a simulation: weights of its basis images and a background, fitted to the image."""

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.reasons import Reason
from catalog.robust import sigma_about_zero
from tasks.compare.match import Match

HUBER = 3.0
SIGMA_SAMPLES = 20_000
# Norm of a column by the largest one, below which nothing of it is left in single precision.
VANISHING = 1e-10


def brightness_columns(bases: NDArray[np.float32]) -> NDArray[np.float32]:
    """The linear unknowns' images (k + 1, ny, nx): every basis, and a constant background."""
    return np.concatenate([bases, np.ones((1, *bases.shape[1:]), np.float32)]).astype(np.float32)


def fit_brightness(match: Match, bases: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Robust weighted fit of image = sum_k c_k basis_k + background.

    Returns the model image (ny, nx) and the coefficients (k + background terms). Raises FailedError when nothing of
    the target is on usable pixels.
    """
    columns = brightness_columns(bases)
    coefficients, _, _ = robust_least_squares(columns, match.image, match.weight)
    return np.tensordot(coefficients, columns, 1), coefficients


def robust_least_squares(
    columns: NDArray[np.float32], image: NDArray[np.float32], weight: NDArray[np.float32], rounds: int = 3
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Solve image = sum_j p_j columns_j over pixels of positive weight, down-weighting outliers (Huber).

    columns (n, ny, nx). Returns p (n,), its covariance (n, n) scaled by the residuals, and the reduced chi square.
    Raises FailedError when fewer pixels than unknowns are usable.
    """
    from tasks.compare.normal_equations import accumulate, residuals

    n = len(columns)
    design = np.ascontiguousarray(columns.reshape(n, -1), np.float32)
    values, base = (np.ascontiguousarray(a.ravel(), np.float32) for a in (image, weight))
    count = int(np.count_nonzero(base > 0))
    if count <= n:
        fault = "no usable pixels lie under the simulated target."
        raise FailedError(Reason.NO_USABLE_PIXELS, fault, "Check the predicted pose, --start-offset and --mask.")
    stride = max(1, base.size // SIGMA_SAMPLES)
    limit = np.inf
    solution = np.zeros(n)
    for _ in range(rounds):
        normal, right, chi_square = accumulate(design, values, base, solution, limit)
        square = np.diag(normal)
        # A column that vanishes beside the others, in single precision, tells nothing: its unknown is 0, not 1e30.
        scale = np.where(square > VANISHING**2 * square.max(), np.sqrt(np.maximum(square, 1e-300)), np.inf)
        inverse = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-12, hermitian=True)
        inverse /= np.outer(scale, scale)
        solution = inverse @ right
        residual = residuals(design, values, base, solution, stride)
        limit = HUBER * max(sigma_about_zero(residual) if residual.size else 0.0, 1e-9)
    _, _, chi_square = accumulate(design, values, base, solution, limit)
    chi_square = float(chi_square) / (count - n)
    return solution, inverse * chi_square, chi_square


def correlation(image: NDArray, model: NDArray, usable: NDArray[np.bool_]) -> float:
    """Pearson correlation over usable pixels; 0 when one of them is constant.

    The image's values are held within the model's whole span of its range: a few cosmic rays would else decide.
    """
    x, y = image[usable].astype(np.float64), model[usable].astype(np.float64)
    if x.size < 2:
        return 0.0
    span = np.ptp(y)
    x = np.clip(x, y.min() - span, y.max() + span)
    x, y = x - x.mean(), y - y.mean()
    # Sums instead of dot products, for which BLAS would wake its threads.
    norm = float(np.sqrt((x * x).sum() * (y * y).sum()))
    return float((x * y).sum()) / norm if norm > 0 else 0.0
