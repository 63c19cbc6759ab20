"""Patches of an image, correlated with the map's texture at every displacement of a search region."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.closeup.texture import Texture

Array = NDArray[np.float64]
Image = NDArray[np.float32]

# A patch needs so much of itself on known pixels, and so much of the map's below it.
KNOWN_SHARE = 0.5
SMALLEST_PATCH_PX = 10


@dataclass(frozen=True)
class Surfaces:
    """Normalised cross-correlation of n patches. centre_px: (n, 2) of their middles in the frame. reach_px: of the
    search. correlation: (n, 2 reach + 1, 2 reach + 1), by how far (y, x) the map's picture of what the patch shows lies
    from the patch; 0 where too little of the map is known there."""

    centre_px: Array
    reach_px: int
    correlation: Image

    def __len__(self) -> int:
        return len(self.centre_px)


def patch_size(shape: tuple[int, int], across: int) -> int:
    """Side of the patches, px, of which `across` make the longer side of a frame (ny, nx)."""
    return max(SMALLEST_PATCH_PX, int(max(shape) // across))


def correlated(image: Texture, simulated: Texture, reach_px: int, across: int) -> Surfaces:
    """Correlations of the patches of `image` (ny, nx) that are known well enough, which do not overlap, with the
    texture `simulated` (ny + 2 reach, nx + 2 reach), whose first pixel lies reach_px before the image's in x and y."""
    ny, nx = image.values.shape
    size = patch_size((ny, nx), across)
    centres, surfaces = [], []
    for y in _starts(ny, size):
        for x in _starts(nx, size):
            part = (slice(y, y + size), slice(x, x + size))
            known = image.known[part]
            if known.mean() < KNOWN_SHARE:
                continue
            below = (slice(y, y + size + 2 * reach_px), slice(x, x + size + 2 * reach_px))
            surface = correlation(image.values[part], known, simulated.values[below], simulated.known[below])
            if surface is not None:
                centres.append((x + (size - 1) / 2, y + (size - 1) / 2))
                surfaces.append(surface)
    width = 2 * reach_px + 1
    stack = np.stack(surfaces) if surfaces else np.zeros((0, width, width), np.float32)
    return Surfaces(np.array(centres, np.float64).reshape(-1, 2), reach_px, stack)


def _starts(length: int, size: int) -> range:
    left = (length % size) // 2
    return range(left, length - size + 1, size)


def correlation(patch: Image, known: NDArray[np.bool_], below: Image, below_known: NDArray[np.bool_]) -> Image | None:
    """Normalised cross-correlation of a patch (m, m) at every place of `below`, over what is known of the patch; None
    for a patch without contrast, or where nowhere enough of `below` is known."""
    import cv2

    mask = known.astype(np.float32)
    off = np.where(known, patch - patch[known].mean(), 0).astype(np.float32)
    contrast = float((off**2).sum())
    if contrast <= 0:
        return None
    count = np.maximum(cv2.matchTemplate(below_known.astype(np.float32), mask, cv2.TM_CCORR), 1e-3)
    total = cv2.matchTemplate(below, mask, cv2.TM_CCORR)
    squares = cv2.matchTemplate(below * below, mask, cv2.TM_CCORR) - total**2 / count
    enough = (count > KNOWN_SHARE * mask.sum()) & (squares > 1e-3 * count)
    if not enough.any():
        return None
    product = cv2.matchTemplate(below, off, cv2.TM_CCORR)
    value = product / np.sqrt(np.maximum(squares, 1e-6) * contrast)
    found: Image = np.where(enough, np.clip(value, -1, 1), 0).astype(np.float32)
    return found
