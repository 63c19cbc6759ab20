"""Maps as GeoTIFF and Cloud Optimized GeoTIFF, by GDAL."""

from pathlib import Path
from typing import Any

import numpy as np

from tasks.atomic import file_put_in_place
from tasks.export.cog import BLOCK_PX, write_cog
from tasks.export.map_image import LAYERS, MapImage
from tasks.export.source import Source
from tasks.publish.variables import FLAGS

DEGREE = "degree"
WITHOUT_UNIT = ("image", "quality")
NOT_AVERAGED = ("longitude", "quality")  # longitude begins again at 0; quality is bits


def write_geotiff(source: Source, mapped: MapImage, path: Path, cloud_optimized: bool = False) -> Path:
    """Write one float32 band per layer, named, with NaN as nodata and the body's CRS, and return `path`.
    cloud_optimized: tiles and overviews in the order that readers over HTTP want."""
    import rasterio

    def fill(file: Any) -> None:
        _fill(file, source, mapped)

    profile = map_profile(mapped)
    if cloud_optimized:
        return write_cog(path, profile, fill, [LAYERS.index(name) + 1 for name in NOT_AVERAGED])
    tiled = {"tiled": True, "blockxsize": BLOCK_PX, "blockysize": BLOCK_PX, "compress": "deflate", "predictor": 3}
    with file_put_in_place(path) as temporary, rasterio.open(temporary, "w", **profile, **tiled) as file:
        fill(file)
    return path


def map_profile(mapped: MapImage) -> dict[str, Any]:
    """What GDAL is to create: one float32 band per layer on the map's grid, NaN as nodata."""
    import rasterio

    rows, columns = mapped.grid.shape
    return {
        "driver": "GTiff",
        "count": len(LAYERS),
        "dtype": "float32",
        "height": rows,
        "width": columns,
        "crs": rasterio.crs.CRS.from_wkt(mapped.grid.projection.crs.to_wkt("WKT2_2019")),
        "transform": mapped.grid.transform,
        "nodata": float("nan"),
    }


def _fill(file: Any, source: Source, mapped: MapImage) -> None:
    for band, name in enumerate(LAYERS, start=1):
        file.write(mapped.layers[name].astype(np.float32, copy=False), band)
        file.set_band_description(band, name)
        file.set_band_unit(band, "" if name in WITHOUT_UNIT else DEGREE)
    file.update_tags(LAYERS.index("quality") + 1, **flag_attributes())
    file.update_tags(**map_attributes(source, mapped))


def flag_attributes() -> dict[str, str]:
    """What the bits of the layer `quality` mean, as CF has it."""
    return {
        "flag_masks": " ".join(str(int(flag)) for flag in FLAGS),
        "flag_meanings": " ".join(str(flag.name).lower() for flag in FLAGS),
    }


def map_attributes(source: Source, mapped: MapImage) -> dict[str, str]:
    """Who made the map of what, as text."""
    cube = source.attributes
    named: dict[str, str] = {
        key: str(cube[key]) for key in ("product", "target", "camera", "utc", "source") if key in cube
    }
    return {
        **named,
        "projection": mapped.grid.projection.name,
        "latitude": "planetocentric",
        "longitude": "positive eastward",
        "resampling": mapped.kernel,
        "max_emission_deg": f"{mapped.max_emission_deg:g}",
    }
