"""The 1-sigma noise of each pixel: by the camera's noise model, or measured from the image itself."""

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Noise
from catalog.robust import sigma_about_zero

QUANTISATION = 1 / np.sqrt(12)


def modelled_noise(image: NDArray[np.float32], model: Noise) -> NDArray[np.float32]:
    """Noise (ny, nx) by variance = read^2 + DN / gain + (relative DN)^2, never below that of rounding to whole DN."""
    signal = np.maximum(image, 0).astype(np.float64)
    variance = model.read_dn**2 + signal / model.gain_e_per_dn + (model.relative * signal) ** 2
    return np.sqrt(np.maximum(variance, QUANTISATION**2)).astype(np.float32)


def measured_noise(image: NDArray[np.float32], usable: NDArray[np.bool_], whole_numbers: bool) -> NDArray[np.float32]:
    """One noise value for the whole image (ny, nx): median absolute deviation of the difference of two Laplacians,
    which no plane and no quadratic surface excites (Immerkaer 1996, Comput. Vis. Image Underst. 64, 300).

    Pixels beside an unusable one do not count. Never below 1e-4 of the brightness range (an image without noise), nor
    below the rounding of whole numbers.
    """
    floor = QUANTISATION if whole_numbers else 0.0
    if usable.any():
        low, high = np.percentile(image[usable], [1, 99])
        floor = max(floor, 1e-4 * float(high - low))
    return np.full(image.shape, max(_high_frequency_sigma(image, usable), floor, 1e-12), np.float32)


def _high_frequency_sigma(image: NDArray[np.float32], usable: NDArray[np.bool_]) -> float:
    if min(image.shape) < 3:
        return 0.0
    across = image[:, :-2] - 2 * image[:, 1:-1] + image[:, 2:]
    mask = across[:-2] - 2 * across[1:-1] + across[2:]
    rows_usable = usable[:, :-2] & usable[:, 1:-1] & usable[:, 2:]
    values = mask[rows_usable[:-2] & rows_usable[1:-1] & rows_usable[2:]]
    return sigma_about_zero(values) / 6 if values.size else 0.0


def completed_noise(noise: NDArray[np.float32], fallback: NDArray[np.float32]) -> NDArray[np.float32]:
    """The file's own noise, with `fallback` where it is not a positive number."""
    with np.errstate(invalid="ignore"):
        return np.where(np.isfinite(noise) & (noise > 0), noise, fallback).astype(np.float32)
