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


SAMPLE = 50_000
REPEATS = 4.0  # times a value occurs on average in numbers that have steps
ON_STEPS = 0.02  # of a step, that its multiples may be off in single precision
DITHER_SEED = 0


def measured_noise(image: NDArray[np.float32], usable: NDArray[np.bool_], whole_numbers: bool) -> NDArray[np.float32]:
    """One noise value for the whole image (ny, nx): median absolute deviation of the difference of two Laplacians,
    which no plane and no quadratic surface excites (Immerkaer 1996, Comput. Vis. Image Underst. 64, 300).

    Pixels beside an unusable one do not count. Numbers that go in steps, whole ones or calibrated ones that were whole,
    are dithered by a step beforehand: the median of small whole numbers would be one of a few values. Never below 1e-4
    of the brightness range (an image without noise), nor below the rounding of the steps.
    """
    step = 1.0 if whole_numbers else 0.0
    if usable.any():
        step = max(step, quantisation_step(image[usable]))
    if step:
        dither = np.random.default_rng(DITHER_SEED).uniform(-step / 2, step / 2, image.shape)
        image = (image + dither).astype(np.float32)
    floor = QUANTISATION * step
    if usable.any():
        low, high = np.percentile(image[usable], [1, 99])
        floor = max(floor, 1e-4 * float(high - low))
    return np.full(image.shape, max(_high_frequency_sigma(image, usable), floor, 1e-12), np.float32)


def quantisation_step(values: NDArray[np.float32]) -> float:
    """The step of numbers that are all multiples of one, in a picture where most occur many times; 0 where there is
    none."""
    sample = values[:: max(1, values.size // SAMPLE)]
    distinct = np.unique(sample)
    if distinct.size < 3 or sample.size < REPEATS * distinct.size:
        return 0.0
    gaps = np.diff(distinct.astype(np.float64))
    step = float(gaps.min())
    off = np.abs(gaps / step - np.round(gaps / step))
    resolved = float(np.spacing(np.float32(np.abs(distinct).max())))
    return step if step > resolved / ON_STEPS and bool((off <= ON_STEPS * np.maximum(gaps / step, 1)).all()) else 0.0


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
