"""How a picture changes when it is displaced, scaled, rolled or blurred, seen by the pixels.

The slopes of the sub-pixel image, weighted by place, are taken by the very filter that blurs it and sums it up to
pixels: the weights are differenced instead of the image.
"""

import numpy as np
from numpy.typing import NDArray

from tasks.joint.parameters import OFFSET, PSF, RANGE, ROLL
from tasks.simulate.pixels import detect, filtered, pixel_weights
from tasks.simulate.trail import Trail, smeared

Image = NDArray[np.float32]
Weights = NDArray[np.float64]
PSF_STEP = 0.04


def changes_of_place(fine: Image, centre_px: NDArray, oversample: int, psf_sigma_px: float, out: Image) -> None:
    """Fill the rows of `out` (8, ny, nx) that offset, range, roll and PSF have in `parameters.NAMES`, per unit of each.

    fine: the picture's sub-pixels (ny*s, nx*s); centre_px: (2,) of the target in it, pixels.
    """
    s = oversample
    still = pixel_weights(s, psf_sigma_px)
    slope = _differenced(still, s)
    leaning = still * _places(len(still), s)
    leaning_slope = _differenced(leaning, s)
    along_x, along_y = filtered(fine, still, slope, s), filtered(fine, slope, still, s)
    ny, nx = along_x.shape
    x = (np.arange(nx, dtype=np.float32) - np.float32(centre_px[0]))[None, :]
    y = (np.arange(ny, dtype=np.float32) - np.float32(centre_px[1]))[:, None]
    out[OFFSET] = -along_x, -along_y
    # Within a pixel the sub-pixels' places differ from its middle: the leaning weights account for that.
    out[RANGE] = x * along_x + y * along_y
    out[RANGE] += filtered(fine, still, leaning_slope, s)
    out[RANGE] += filtered(fine, leaning_slope, still, s)
    out[ROLL] = y * along_x - x * along_y
    out[ROLL] += filtered(fine, leaning, slope, s)
    out[ROLL] -= filtered(fine, slope, leaning, s)
    out[ROLL] *= np.float32(np.pi / 180)
    wider, narrower = (detect(fine, s, psf_sigma_px * factor) for factor in (1 + PSF_STEP, 1 / (1 + PSF_STEP)))
    out[PSF] = (wider - narrower) / np.float32(2 * np.log1p(PSF_STEP))


def _differenced(weights: Weights, oversample: int) -> Weights:
    """Weights that give the slope, per pixel, of what `weights` give."""
    return np.convolve(weights, [-0.5, 0.0, 0.5]) * oversample


def _places(count: int, oversample: int) -> Weights:
    """Where the weights' sub-pixels are, pixels from the pixel's middle."""
    return (np.arange(count) - (count - 1) / 2) / oversample


# Half of the difference, px, from which the image's change with the trail is taken.
TRAIL_STEP_PX = 0.25


def trail_columns(sharp: Image, trail_px: Trail) -> Image:
    """Change per pixel of the trail's x and y (2, ny, nx) of the image that is `sharp` (ny, nx) without it."""
    changes = []
    for x, y in ((TRAIL_STEP_PX, 0.0), (0.0, TRAIL_STEP_PX)):
        more, less = (smeared(sharp, (trail_px[0] + sign * x, trail_px[1] + sign * y)) for sign in (1, -1))
        changes.append((more - less) / np.float32(2 * TRAIL_STEP_PX))
    return np.stack(changes)
