"""A base map averaged to the size of what samples it."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import BaseMap

Image = NDArray[np.float32]

# Width of the map's smoothing in sub-pixels: what is finer would be sampled as noise.
SMOOTHING, MIN_SMOOTHING = 0.5, 0.2


def map_as_coarse_as(basemap: BaseMap, pixel_rad: float) -> Image:
    """The map's albedo averaged to about `pixel_rad` on the ground: a map finer than the sub-pixels that sample it
    would come out speckled."""
    rows = basemap.albedo.shape[0]
    pixels = pixel_rad * rows / np.pi
    return _averaged(_Kept(basemap), max(1, int(pixels)), round(SMOOTHING * pixels / max(1, int(pixels)), 1))


class _Kept:
    """A map as a key of the cache below."""

    def __init__(self, basemap: BaseMap) -> None:
        self.basemap = basemap

    def __hash__(self) -> int:
        return id(self.basemap.albedo)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Kept) and other.basemap.albedo is self.basemap.albedo


@lru_cache(maxsize=4)
def _averaged(kept: _Kept, factor: int, sigma: float) -> Image:
    import cv2

    albedo = kept.basemap.albedo
    rows, columns = albedo.shape
    if factor > 1:
        albedo = cv2.resize(albedo, (max(columns // factor, 4), max(rows // factor, 2)), interpolation=cv2.INTER_AREA)
    if sigma < MIN_SMOOTHING:
        return albedo
    rim = int(np.ceil(4 * sigma))
    wrapped = cv2.copyMakeBorder(albedo, 0, 0, rim, rim, cv2.BORDER_WRAP)
    return np.ascontiguousarray(cv2.GaussianBlur(wrapped, (0, 0), sigma)[:, rim:-rim])
