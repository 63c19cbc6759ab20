"""Maps as Zarr: CF coordinates in metres, a CF grid mapping with WKT, and GDAL's GeoTransform."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from tasks.atomic import folder_put_in_place
from tasks.export.geotiff import map_attributes
from tasks.export.map_image import LAYERS, MapImage
from tasks.export.source import Source
from tasks.publish.cube import CONVENTIONS, write_group
from tasks.publish.plain_cube import compressor
from tasks.publish.variables import BY_NAME, FLAGS

if TYPE_CHECKING:
    import xarray as xr

GRID_MAPPING = "spatial_ref"  # the name that rioxarray and GDAL look for
CHUNK_PX = 512


def map_dataset(source: Source, mapped: MapImage) -> "xr.Dataset":
    """The layers over (y, x), CF coordinates in metres, and the map's place on the body."""
    import xarray as xr

    grid = mapped.grid
    layers = {name: (("y", "x"), _values(mapped, name), _attributes(name)) for name in LAYERS}
    crs = grid.projection.crs
    spatial_ref = {**crs.to_cf(), "GeoTransform": " ".join(repr(value) for value in grid.transform.to_gdal())}
    coordinates = {
        "x": ("x", grid.x_m(), {"standard_name": "projection_x_coordinate", "units": "m", "axis": "X"}),
        "y": ("y", grid.y_m(), {"standard_name": "projection_y_coordinate", "units": "m", "axis": "Y"}),
        GRID_MAPPING: ((), np.int32(0), spatial_ref),
    }
    attributes = {"Conventions": CONVENTIONS, "title": f"Map of {source.product}", **map_attributes(source, mapped)}
    return xr.Dataset(layers, coordinates, attributes)


def write_zarr_map(source: Source, mapped: MapImage, path: Path) -> Path:
    """Write `map_dataset` as a Zarr v3 group, each layer one file (a shard) whose chunks can be read one by one, and
    return `path`."""
    chunks = tuple(min(CHUNK_PX, n) for n in mapped.grid.shape)
    whole = tuple(chunk * -(-n // chunk) for chunk, n in zip(chunks, mapped.grid.shape, strict=True))
    form = {"chunks": chunks, "shards": whole, "compressors": [compressor()]}
    encoding: dict[str, dict[str, Any]] = {name: dict(form) for name in LAYERS}
    encoding |= {axis: {"_FillValue": None} for axis in ("x", "y")}  # CF 2.5.1: coordinates have no missing values
    with folder_put_in_place(path) as temporary:
        temporary.rmdir()
        write_group(map_dataset(source, mapped), temporary, encoding)
    return path


def _values(mapped: MapImage, name: str) -> NDArray[Any]:
    """A layer; flags as whole numbers, those of a pixel off the body where the image does not show the place."""
    values = mapped.layers[name]
    if name != "quality":
        return values
    return np.where(np.isfinite(values), values, np.float32(Quality.OFF_BODY)).astype(np.uint16)


def _attributes(name: str) -> dict[str, Any]:
    kept = ("long_name", "units", "standard_name")
    known = {key: value for key, value in BY_NAME[name].attributes.items() if key in kept}
    if name == "quality":
        meanings = " ".join(str(flag.name).lower() for flag in FLAGS)
        known |= {"flag_masks": [int(flag) for flag in FLAGS], "flag_meanings": meanings}
    return {**known, "grid_mapping": GRID_MAPPING}
