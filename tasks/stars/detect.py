"""Detection of star images: peaks of the frame filtered with the star image's own shape, against the local noise."""

import numpy as np
from numpy.typing import NDArray

from tasks.stars.settings import DetectionSettings

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
FEWEST_IN_TILE = 40
CLIP, CLIPPINGS = 3.0, 4
DIRECTIONS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))


def star_kernel(shape_px2: Array) -> Array:
    """The matched filter for a star image of this covariance (2, 2), pixels^2, that ignores a level and a slope of the
    sky: a Gaussian less its mean over the kernel (DAOFIND; Stetson 1987, PASP 99, 191). Of unit response to a Gaussian
    of height 1."""
    widest = float(np.sqrt(np.linalg.eigvalsh(shape_px2)[-1]))
    half = max(2, int(np.ceil(3.5 * widest)))
    y, x = np.mgrid[-half : half + 1, -half : half + 1].astype(float)
    inverse = np.linalg.inv(shape_px2)
    size = inverse[0, 0] * x**2 + 2 * inverse[0, 1] * x * y + inverse[1, 1] * y**2
    profile = np.exp(-0.5 * size)
    lowered = profile - profile.mean()
    return np.asarray(lowered / np.sum(lowered * profile))


def filled(image: Array, usable: Mask, reach_px: float = 4.0) -> Array:
    """The image (ny, nx) with unusable pixels replaced by the mean of usable ones around them (Gaussian weights); far
    from any by the nearest such mean."""
    import cv2

    if usable.all():
        return image
    size = 2 * int(np.ceil(3 * reach_px)) + 1
    values = np.where(usable, image, 0.0).astype(np.float32)
    weight = cv2.GaussianBlur(usable.astype(np.float32), (size, size), reach_px)
    mean = cv2.GaussianBlur(values, (size, size), reach_px) / np.maximum(weight, 1e-6)
    level = float(np.median(image[usable])) if usable.any() else 0.0
    return np.where(usable, image, np.where(weight > 1e-3, mean, level))


def local_noise(response: Array, usable: Mask, tile_px: int) -> Array:
    """Robust 1-sigma scatter (ny, nx) of a filtered image, by tiles and interpolated between their centres; inf where
    no tile near has enough usable pixels. Structure (a ring, a limb) counts as noise: nothing is detected on it unless
    it stands out."""
    ny, nx = response.shape
    rows, columns = max(1, round(ny / tile_px)), max(1, round(nx / tile_px))
    tall, wide = -(-ny // rows), -(-nx // columns)
    padding = ((0, rows * tall - ny), (0, columns * wide - nx))
    values = np.pad(np.where(usable, response, np.nan), padding, constant_values=np.nan)
    tiles = values.reshape(rows, tall, columns, wide).swapaxes(1, 2).reshape(rows, columns, -1)
    enough = np.isfinite(tiles).sum(axis=-1) >= min(FEWEST_IN_TILE, tall * wide)
    sigma = np.full((rows, columns), np.nan)
    if not enough.any():
        return np.full(response.shape, np.inf)
    sigma[enough] = clipped_scatter(tiles[enough])
    lowest = np.nanmedian(sigma) * 0.3  # flat areas (fills, clipped darkness) have no scatter of their own
    sigma = _without_gaps(np.maximum(sigma, max(lowest, 1e-12)))
    return np.asarray(_shares(ny, tall, rows) @ sigma @ _shares(nx, wide, columns).T)


def _shares(pixels: int, tile_px: int, tiles: int) -> Array:
    """Weights (pixels, tiles) of linear interpolation between the centres of tiles; beyond the last ones theirs."""
    place = np.clip((np.arange(pixels) - (tile_px - 1) / 2) / tile_px, 0, tiles - 1)
    return np.maximum(1 - np.abs(place[:, None] - np.arange(tiles)), 0.0)


def structure_around(response: Array, reach_px: int) -> Array:
    """Root mean square (ny, nx) of the filtered image in the second most lively of eight squares around each pixel, at
    the distance `reach_px`: a ridge, a limb or an edge runs through two of them, a neighbouring star lies in one."""
    import cv2

    side = 2 * (reach_px // 3) + 1
    energy = cv2.blur(response**2, (side, side), borderType=cv2.BORDER_REFLECT)
    ny, nx = response.shape
    wide = np.pad(energy, reach_px, mode="reflect" if min(ny, nx) > reach_px else "edge")
    shifted = [
        wide[reach_px * (1 + dy) : reach_px * (1 + dy) + ny, reach_px * (1 + dx) : reach_px * (1 + dx) + nx]
        for dx, dy in DIRECTIONS
    ]
    highest = np.maximum(shifted[0], shifted[1])
    second = np.minimum(shifted[0], shifted[1])
    for each in shifted[2:]:
        second = np.maximum(second, np.minimum(highest, each))
        highest = np.maximum(highest, each)
    return np.asarray(np.sqrt(np.maximum(second, 0.0)))


def clipped_scatter(values: Array) -> Array:
    """Standard deviation (n,) of rows of values (n, m) with NaN for none, without the outermost: unlike the median
    deviation it also serves integers whose noise is a fraction of a step."""
    count = np.isfinite(values).sum(axis=-1)
    ascending = np.sort(values, axis=-1)  # NaN last
    every = np.arange(len(values))
    median = (ascending[every, (count - 1) // 2] + ascending[every, count // 2]) / 2
    square = np.sort((values - median[:, None]) ** 2, axis=-1)
    total = np.cumsum(square, axis=-1)
    for _ in range(CLIPPINGS):
        # What is kept of the ascending squares is always a first part of them.
        count = (square <= (CLIP**2 * total[every, count - 1] / count)[:, None]).sum(axis=-1)
    return np.asarray(np.sqrt(total[every, count - 1] / count))


def _without_gaps(tiles: Array) -> Array:
    from scipy.ndimage import distance_transform_edt

    gaps = ~np.isfinite(tiles)
    if not gaps.any():
        return tiles
    nearest = distance_transform_edt(gaps, return_distances=False, return_indices=True)
    return np.asarray(tiles[tuple(nearest)])


def peaks(image: Array, usable: Mask, shape_px2: Array, settings: DetectionSettings) -> tuple[NDArray[np.int_], Array]:
    """Pixels (n, 2), x and y, of local maxima of the filtered image that stand out of the local noise and of the
    structure around them, and their signal to noise (n,), highest first."""
    import cv2
    from scipy.ndimage import maximum_filter

    kernel = star_kernel(shape_px2)
    whole = filled(image, usable)
    response = cv2.filter2D(whole.astype(np.float64), cv2.CV_64F, kernel, borderType=cv2.BORDER_REFLECT)
    core = np.abs(kernel) > 0.3 * np.abs(kernel).max()
    around = cv2.filter2D(
        (~usable).astype(np.float32), cv2.CV_32F, core.astype(np.float32), borderType=cv2.BORDER_REFLECT
    )
    free = usable & (around <= 0.15 * core.sum())
    ratio = np.where(free, response / local_noise(response, free, settings.tile_px), -np.inf)
    side = max(3, 2 * (kernel.shape[0] // 4) + 1)
    highest = (ratio == maximum_filter(ratio, size=side)) & (ratio >= settings.least_signal_to_noise)
    highest &= response >= settings.above_structure * structure_around(response, kernel.shape[0])
    y, x = np.nonzero(highest)
    order = np.argsort(-ratio[y, x], kind="stable")
    return np.stack([x, y], axis=-1)[order], ratio[y, x][order]
