"""The pixels of a mosaic, and the blocks in which they are made."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.target import Target
from tasks.export.map_grid import MapGrid, grid_of, map_projection, signed_deg

Array = NDArray[np.float64]
Block = tuple[slice, slice]
LAYERS_PER_IMAGE = 10  # float64 arrays that a block keeps of every image
SMALLEST_BLOCK, LARGEST_BLOCK = 64, 512
# Choice: a map of more blocks than this is written in files of several blocks each; of fewer files a cluster of Dask
# would have too little to share.
MOST_FILES = 256
BYTES_PER_PIXEL = 44  # of the layers of a finished block


@dataclass(frozen=True)
class MosaicGrid:
    """A whole map. The equirectangular one begins at the north pole and at the east longitude `west_deg`: 0 unless its
    middle is given."""

    grid: MapGrid
    west_deg: float = 0.0

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.grid.shape

    @property
    def equirectangular(self) -> bool:
        """Whether rows have one latitude and columns one longitude."""
        return self.grid.projection.name == "equirectangular"

    @property
    def pixel_km(self) -> float:
        """Side of a pixel where the map is true."""
        return self.grid.step_m / 1e3

    def places(self, block: Block) -> tuple[Array, Array]:
        """Latitude and east longitude (rows, columns) of the pixels' centres; NaN where the map shows nothing."""
        x, y = np.meshgrid(self.grid.x_m()[block[1]], self.grid.y_m()[block[0]])
        return self.grid.projection.latitude_longitude(x, y)

    def latitude(self) -> Array:
        """Of the rows of an equirectangular map."""
        return np.asarray(90 - (np.arange(self.shape[0]) + 0.5) * 180 / self.shape[0])

    def longitude(self) -> Array:
        """Of the columns of an equirectangular map: east, rising from the left edge, also through 0 or 360."""
        return np.asarray(self.west_deg + (np.arange(self.shape[1]) + 0.5) * 360 / self.shape[1])

    def geo_transform(self) -> tuple[float, ...]:
        """GDAL's six numbers, from column and row to the coordinates of the map: degrees of an equirectangular one,
        metres of others."""
        if not self.equirectangular:
            return tuple(self.grid.transform.to_gdal())
        step = 180 / self.shape[0]
        return self.west_deg, step, 0.0, 90.0, 0.0, -step

    def blocks(self, side: int) -> Iterator[Block]:
        """All blocks of at most `side` pixels."""
        rows, columns = self.shape
        return blocks_in((slice(0, rows), slice(0, columns)), side)


def blocks_in(place: Block, side: int) -> Iterator[Block]:
    """All blocks of at most `side` pixels of a part of a map."""
    rows, columns = place
    for top in range(rows.start, rows.stop, side):
        for left in range(columns.start, columns.stop, side):
            yield slice(top, min(top + side, rows.stop)), slice(left, min(left + side, columns.stop))


def mosaic_grid(
    projection: str, target: Target, pixel_km: float, centre_deg: tuple[float, float], middle_deg: float | None
) -> MosaicGrid:
    """The grid of the whole body (orthographic, polar: of a hemisphere). Raises RefusedError as `map_projection`."""
    if projection == "equirectangular" and middle_deg is None:
        middle_deg = 180.0
    chosen = map_projection(projection, target, pixel_km, centre_deg, middle_deg)
    return MosaicGrid(grid_of(chosen, chosen.extent_m), signed_deg(middle_deg or 0.0) - 180.0)


def blocks_per_file(shape: tuple[int, int], side: int, memory_mb: float) -> int:
    """Along each axis, how many blocks one file of a layer holds (a shard of Zarr), whose layers are all kept until it
    is written: no more than the memory has room for."""
    blocks = math.ceil(shape[0] / side) * math.ceil(shape[1] / side)
    room = math.sqrt(memory_mb * 1e6 / BYTES_PER_PIXEL) / side
    return max(min(math.ceil(math.sqrt(blocks / MOST_FILES)), int(room)), 1)


def block_side(images: int, memory_mb: float) -> int:
    """Side of blocks whose values of all images fit into the memory: a power of two."""
    pixels = memory_mb * 1e6 / (8 * LAYERS_PER_IMAGE * max(images, 1))
    side = 2 ** int(math.log2(max(math.sqrt(pixels), 1)))
    return min(max(side, SMALLEST_BLOCK), LARGEST_BLOCK)
