"""Structural similarity of an image and its simulation (paper, section 3.2)."""

import numpy as np
from numpy.typing import NDArray

GAUSSIAN_SIGMA_PX = 1.5


def ssim(a: NDArray, b: NDArray, usable: NDArray[np.bool_]) -> float:
    """Mean SSIM of `a` and `b` (ny, nx) over `usable` pixels.

    The index is the product of the paper's three terms (luminance, contrast, structure), computed in Gaussian windows
    (sigma 1.5 px) with the usual small constants K1 = 0.01, K2 = 0.03 of the image's 0.1-99.9 % range (Wang et al.
    2004, IEEE Trans. Image Process. 13, 600). Unusable pixels are replaced by the simulation's before the windows are
    applied, so that they neither help nor harm, and are left out of the mean. Returns NaN without usable pixels.
    """
    from skimage.metrics import structural_similarity

    if not usable.any():
        return float("nan")
    low, high = np.percentile(a[usable], [0.1, 99.9])
    if high <= low:
        return 0.0
    patched = np.where(usable, a, b).astype(np.float32)
    _, index = structural_similarity(
        patched,
        b.astype(np.float32),
        data_range=float(high - low),
        gaussian_weights=True,
        sigma=GAUSSIAN_SIGMA_PX,
        use_sample_covariance=False,
        full=True,
    )
    return float(index[usable].mean(dtype=np.float64))
