"""The old base map where no image sees the ground, brought to the level and contrast of the new one."""

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import BaseMap
from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.geometry.bilinear import map_values
from tasks.improve.sums import Sums
from tasks.mosaic.grid import MosaicGrid

Image = NDArray[np.float32]
LEAST_REFLECTANCE = 0.1  # of the mean: a map is positive


def old_map_on(grid: MosaicGrid, old: BaseMap) -> Image:
    """The old map's values at the pixels (rows, columns) of an equirectangular grid."""
    latitude, longitude = np.meshgrid(grid.latitude(), grid.longitude(), indexing="ij")
    return map_values(old.albedo, old.left_edge_deg, latitude, longitude).astype(np.float32)


def levelled(old: Image, reflectance: Image, latitude_deg: NDArray[np.float64]) -> Image:
    """The old map times a gain plus a level that bring it nearest to the new one (weighted by area) where both are."""
    shown = np.isfinite(reflectance)
    if not shown.any():
        raise RefusedError(Reason.NO_USABLE_IMAGE, "no image shows lit ground within the limits.", "Widen them.")
    area = np.broadcast_to(np.cos(np.radians(latitude_deg))[:, None], old.shape)[shown]
    x, y = old[shown].astype(np.float64), reflectance[shown].astype(np.float64)
    mx, my = np.average(x, weights=area), np.average(y, weights=area)
    spread = np.average((x - mx) ** 2, weights=area)
    gain = np.average((x - mx) * (y - my), weights=area) / spread if spread > 0 else 0.0
    return np.maximum(my + max(gain, 0.0) * (old - mx), LEAST_REFLECTANCE * my).astype(np.float32)


def filled(sums: Sums, old: Image, old_weight: float) -> Image:
    """The new map (rows, columns), the old one (levelled) with a weight of its own counted in everywhere."""
    seen = sums.weight[sums.shown]
    own = old_weight * float(np.median(seen)) if len(seen) else 1.0
    return ((sums.value + own * old) / (sums.weight + own)).astype(np.float32)


def base_map_of(values: Image, name: str, left_edge_deg: float) -> BaseMap:
    """A base map of values, relative to their mean."""
    return BaseMap(name, (values / values.mean()).astype(np.float32), left_edge_deg, "not in a file")
