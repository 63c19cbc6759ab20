"""What each image alone says: McEwen's limb weight, in closed form."""

from dataclasses import dataclass

import numpy as np

from tasks.photometry.region import RegionPixels


@dataclass(frozen=True)
class ImageLimbWeight:
    """value: L of one image, the share of Lommel-Seeliger; sigma: 1-sigma; None where the region cannot tell."""

    value: float | None
    sigma: float | None


def limb_weights(pixels: RegionPixels) -> list[ImageLimbWeight]:
    """L of brightness = A (L 2 mu0 / (mu0 + mu) + (1 - L) mu0) for every image, by linear least squares; 1-sigma from
    the scatter of patches of ground, as in `fit.fit_law`."""
    return [_of_one(pixels, image) for image in range(len(pixels.products))]


def _of_one(pixels: RegionPixels, image: int) -> ImageLimbWeight:
    mine = pixels.image == image
    mu0, mu, value = (part[mine] for part in (pixels.mu0, pixels.mu, pixels.value / pixels.albedo))
    design = np.stack([2 * mu0 / np.maximum(mu0 + mu, 1e-6), mu0], axis=1)
    inverse = np.linalg.pinv(design.T @ design)
    a, b = coefficients = inverse @ design.T @ value
    _, tile = np.unique(pixels.tile[mine], return_inverse=True)
    tiles = int(tile.max()) + 1
    if tiles < 6 or a + b <= 0:
        return ImageLimbWeight(None, None)
    residual = value - design @ coefficients
    scores = np.stack([np.bincount(tile, residual * column, minlength=tiles) for column in design.T])
    covariance = inverse @ (scores @ scores.T) @ inverse * tiles / (tiles - 2)
    slope = np.array([b, -a]) / (a + b) ** 2
    return ImageLimbWeight(float(a / (a + b)), float(np.sqrt(slope @ covariance @ slope)))
