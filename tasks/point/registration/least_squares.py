"""Least squares on intensities: offset, brightness of each basis image and background, solved together."""

import numpy as np
from numpy.typing import NDArray

from tasks.compare.brightness import brightness_columns, correlation, fit_brightness, robust_least_squares
from tasks.compare.match import Match
from tasks.point.registration.base import Shift

MAX_ITERATIONS = 15
CONVERGED_PX = 3e-3
NEAR_PX = 0.7


def moved(image: NDArray[np.float32], offset_px: NDArray[np.float64]) -> NDArray[np.float32]:
    """`image` (ny, nx) displaced by (dx, dy) pixels, cubic, edges replicated.

    Catmull and Rom's cubic keeps a slope where it is. OpenCV's own (a = -0.75) moves it up to 0.04 px too far or too
    little, and before its version 5 rounds displacements to 1/32 px.
    """
    import cv2

    whole = np.floor(offset_px).astype(int)
    if whole.any():
        ny, nx = image.shape
        rows, columns = (np.clip(np.arange(n) - shift, 0, n - 1) for n, shift in ((ny, whole[1]), (nx, whole[0])))
        image = image[rows[:, None], columns]
    kernel_x, kernel_y = (catmull_rom(float(part)) for part in np.asarray(offset_px) - whole)
    return cv2.sepFilter2D(image, -1, kernel_x, kernel_y, anchor=(2, 2), borderType=cv2.BORDER_REPLICATE)


def catmull_rom(fraction: float) -> NDArray[np.float64]:
    """Weights (4,) of the values at x - 2, x - 1, x, x + 1 that give the value at x - fraction, 0 <= fraction < 1
    (Keys 1981, IEEE Trans. Acoust. Speech Signal Process. 29, 1153, with a = -1/2)."""
    t = 1 - fraction
    return np.array(
        [
            -0.5 * t + t**2 - 0.5 * t**3,
            1 - 2.5 * t**2 + 1.5 * t**3,
            0.5 * t + 2 * t**2 - 1.5 * t**3,
            -0.5 * t**2 + 0.5 * t**3,
        ]
    )


def register_least_squares(match: Match) -> Shift:
    """Offset by Gauss-Newton steps on mean squares, where each step also solves the brightness of every basis image
    and the background; coarse to fine, so that it starts from some pixels away."""
    offset = np.zeros(2)
    iterations = 0
    covariance = np.full((2, 2), np.nan)
    step, _ = gauss_newton_step(match.image, match.weight, match.simulation.bases)
    near = float(np.hypot(*step)) < NEAR_PX
    for blur_px in (0.0,) if near else (4.0, 1.5, 0.0):
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
    columns = brightness_columns(bases)
    coefficients, _, _ = robust_least_squares(columns, image, weight)
    d_row, d_column = np.gradient(np.tensordot(coefficients, columns, 1))
    moves = np.stack([-d_column, -d_row]).astype(np.float32)
    solution, covariance, _ = robust_least_squares(np.concatenate([columns, moves]), image, weight)
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
