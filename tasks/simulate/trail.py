"""An exposure during which the boresight drifted: every point is spread evenly along a line, whose middle is its place
at mid-exposure. The PSF is then the Gaussian of the optics convolved with a box along that line."""

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
Trail = tuple[float, float]

# Points of a trail: more than sixteen to a pixel for the longest that are expected.
LINE_POINTS = 512


def smeared(image: Image, trail_px: Trail) -> Image:
    """`image` (ny, nx) spread evenly along a line of pixels (x, y) that is centred on each pixel; itself for (0, 0)."""
    import cv2

    if trail_px == (0.0, 0.0):
        return image
    return np.asarray(cv2.filter2D(image, cv2.CV_32F, line_kernel(trail_px), borderType=cv2.BORDER_REPLICATE))


def line_kernel(trail_px: Trail) -> NDArray[np.float64]:
    """Weights (n, n), n odd, of a line (x, y) of pixels centred on the middle one: many points of it, each shared
    bilinearly among four pixels."""
    reach = int(np.ceil(max(abs(part) for part in trail_px) / 2)) + 1
    weights = np.zeros((2 * reach + 1, 2 * reach + 1))
    along = (np.arange(LINE_POINTS) + 0.5) / LINE_POINTS - 0.5
    x, y = (reach + part * along for part in trail_px)
    left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    fx, fy = x - left, y - top
    for right, wx in ((0, 1 - fx), (1, fx)):
        for below, wy in ((0, 1 - fy), (1, fy)):
            np.add.at(weights, (top + below, left + right), wx * wy)
    return weights / LINE_POINTS
