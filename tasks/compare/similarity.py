"""Structural similarity of an image and its simulation (paper, section 3.2)."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

Array = NDArray[np.float64]
WINDOW_RADIUS_SIGMAS = 3.5


class SsimSettings(BaseModel):
    """luminance, contrast, structure: exponents of the paper's three terms; the paper has 1 for each, 0 leaves one out.
    window: `gaussian` of sigma_px, around every pixel, or `whole`, one sample of all usable pixels (the formula read
    literally). k1, k2: the constants that keep dark and flat windows finite, in parts of the image's range; the paper's
    formula has none, the function that it names (MATLAB's ssim) these."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    luminance: float = Field(1.0, ge=0)
    contrast: float = Field(1.0, ge=0)
    structure: float = Field(1.0, ge=0)
    window: Literal["gaussian", "whole"] = "gaussian"
    sigma_px: float = Field(1.5, gt=0, le=50)
    k1: float = Field(0.01, ge=0)
    k2: float = Field(0.03, ge=0)


def ssim(a: NDArray, b: NDArray, usable: NDArray[np.bool_], settings: SsimSettings | None = None) -> float:
    """Mean SSIM of `a` and `b` (ny, nx) over `usable` pixels: luminance^l contrast^c structure^s (paper, eq. 10), with
    the constants C1 = (k1 L)^2, C2 = (k2 L)^2, C3 = C2 / 2 of Wang et al. (2004, IEEE Trans. Image Process. 13, 600),
    L being the image's 0.1-99.9 % range.

    Windows: see `SsimSettings`. Masking: unusable pixels are replaced by the simulation's before the windows are
    applied, so that they neither help nor harm, and are left out of the mean. Returns NaN without usable pixels, 0 for
    a constant image. A negative structure keeps its sign under any exponent.
    """
    settings = settings or SsimSettings()
    if not usable.any():
        return float("nan")
    low, high = np.percentile(a[usable], [0.1, 99.9])
    if not high > low:
        return 0.0
    terms = similarity_terms(np.where(usable, a, b), b, usable, float(high - low), settings)
    luminance, contrast, structure = (term[usable] if term.ndim else term for term in terms)
    index = luminance**settings.luminance * contrast**settings.contrast
    index = index * np.sign(structure) * np.abs(structure) ** settings.structure
    return float(np.mean(index))


def similarity_terms(
    a: NDArray, b: NDArray, usable: NDArray[np.bool_], span: float, settings: SsimSettings
) -> tuple[Array, Array, Array]:
    """Luminance, contrast and structure: (ny, nx) each, or () for the window `whole`."""
    # Around a common middle, where the squares lose no digits; only the luminance needs the level itself.
    middle = float(np.mean(b[usable]))
    x, y = (np.asarray(image, np.float64) - middle for image in (a, b))
    mean = local_mean(settings.sigma_px) if settings.window == "gaussian" else sample_mean(usable)
    mx, my = mean(x), mean(y)
    vx, vy = (np.maximum(mean(v * v) - m * m, 0) for v, m in ((x, mx), (y, my)))
    covariance = mean(x * y) - mx * my
    c1, c2 = (settings.k1 * span) ** 2, (settings.k2 * span) ** 2
    deviations = np.sqrt(vx * vy)
    mx, my = mx + middle, my + middle
    return (
        _ratio(2 * mx * my + c1, mx**2 + my**2 + c1),
        _ratio(2 * deviations + c2, vx + vy + c2),
        _ratio(covariance + c2 / 2, deviations + c2 / 2),
    )


def local_mean(sigma_px: float):  # type: ignore[no-untyped-def]
    """Function that gives the Gaussian-weighted mean around every pixel, edges reflected."""
    import cv2

    size = 2 * int(WINDOW_RADIUS_SIGMAS * sigma_px + 0.5) + 1
    return lambda image: cv2.GaussianBlur(image, (size, size), sigma_px, borderType=cv2.BORDER_REFLECT)


def sample_mean(usable: NDArray[np.bool_]):  # type: ignore[no-untyped-def]
    """Function that gives the mean of all usable pixels."""
    return lambda image: np.asarray(image[usable].mean())


def _ratio(top: Array, bottom: Array) -> Array:
    """top / bottom; 1 where both are nothing, as of two equal flat windows."""
    return np.divide(top, bottom, out=np.ones_like(bottom), where=bottom > 0)
