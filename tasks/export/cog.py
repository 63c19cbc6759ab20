"""Cloud Optimized GeoTIFF, by GDAL: overviews are means, but for bands of which a mean says nothing."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tasks.atomic import file_put_in_place

BLOCK_PX = 256


def write_cog(path: Path, profile: Mapping[str, Any], fill: Callable[[Any], None], nearest: Sequence[int] = ()) -> Path:
    """Write a Cloud Optimized GeoTIFF, tiles and overviews in the order that readers over HTTP want, and return `path`.
    profile: of a plain one, as rasterio takes it; fill: writes bands, names and tags into the open file. nearest:
    numbers of bands (from 1) whose overviews hold values of single pixels: flags, indices, angles that begin again."""
    import rasterio
    from rasterio.enums import Resampling
    from rasterio.shutil import copy

    tiles = {"tiled": True, "blockxsize": BLOCK_PX, "blockysize": BLOCK_PX, "BIGTIFF": "IF_SAFER"}
    with file_put_in_place(path) as temporary, TemporaryDirectory(prefix=".cog", dir=path.parent) as folder:
        plain = Path(folder) / "plain.tif"
        with rasterio.open(plain, "w", **profile, **tiles) as file:
            fill(file)
        factors = _factors(max(profile["height"], profile["width"]))
        if factors:
            # GDAL resamples all bands of a file alike; those of `nearest` are written over.
            with rasterio.Env(TIFF_USE_OVR="YES", BIGTIFF_OVERVIEW="IF_SAFER"), rasterio.open(plain, "r+") as file:
                file.build_overviews(factors, Resampling.average)
        for number, factor in enumerate(factors, start=1):
            _write_over(plain, number, factor, nearest)
        options = {"blocksize": BLOCK_PX, "compress": "deflate", "predictor": "yes"}
        copy(str(plain), str(temporary), driver="COG", **options)
    return path


def _factors(side: int) -> list[int]:
    """Those of GDAL's own COGs: until the longer side fits into a block."""
    factors: list[int] = []
    while side > BLOCK_PX * 2 ** len(factors):
        factors.append(2 ** (len(factors) + 1))
    return factors


def _write_over(plain: Path, number: int, factor: int, bands: Sequence[int]) -> None:
    """Put single pixels of `plain` into the overview of `factor`, the file's `number`-th (from 1)."""
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning
    from rasterio.windows import Window

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)  # overviews have no place of their own
        with rasterio.open(plain) as whole, rasterio.open(f"GTIFF_DIR:{number}:{plain}.ovr", "r+") as overview:
            for top in range(0, overview.height, BLOCK_PX):
                rows = min(BLOCK_PX, overview.height - top)
                window = Window(0, top * factor, whole.width, min(rows * factor, whole.height - top * factor))
                for band in bands:
                    values = whole.read(band, window=window)[::factor, ::factor]
                    place = Window(0, top, values.shape[1], values.shape[0])
                    overview.write(np.ascontiguousarray(values), band, window=place)
