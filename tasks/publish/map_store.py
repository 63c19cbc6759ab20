"""Maps that are written block by block: a Zarr v3 group with CF coordinates and a CRS."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tasks.publish.cube import CONVENTIONS, write_group
from tasks.publish.plain_cube import compressor
from tasks.publish.variables import Variable

if TYPE_CHECKING:
    import xarray as xr


def create_map(
    path: Path,
    variables: Sequence[Variable],
    coordinates: Mapping[str, Any],
    parts: tuple[tuple[int, ...], tuple[int, ...]],
    attributes: Mapping[str, Any],
    extra: Mapping[str, Any],
) -> None:
    """Make the group; its variables hold nothing until `write_block` has put every block in its place. coordinates,
    extra: as xarray takes variables; the variables have the dimensions of `variables`, whose lengths the coordinates
    give. parts: shapes of the blocks that are compressed and read one by one (chunks), and of those that are written as
    one file each (shards), a multiple of the former. Only the variables have a fill value: CF (2.5.1) wants none of
    coordinates and of their bounds."""
    import dask.array as da
    import xarray as xr

    chunks, shards = parts
    sizes = {name: len(given[1]) for name, given in coordinates.items() if given[0] == name}
    layers: dict[str, Any] = {}
    encoding: dict[str, dict[str, Any]] = {}
    for variable in variables:
        shape = tuple(sizes[dim] for dim in variable.dims)
        kind = np.dtype(variable.dtype)
        layers[variable.name] = (variable.dims, da.zeros(shape, dtype=kind, chunks=shards), variable.attributes)
        encoding[variable.name] = {"chunks": chunks, "compressors": [compressor()]}
        if shards != chunks:
            encoding[variable.name]["shards"] = shards
        if kind.kind != "f":
            encoding[variable.name]["_FillValue"] = None
    dataset = xr.Dataset(layers, coordinates, {"Conventions": CONVENTIONS, **attributes}).assign(extra)
    empty_group = dataset.drop_vars(list(layers))
    write_group(empty_group, path, {str(name): {"_FillValue": None} for name in empty_group.variables})
    _add_layers(path, dataset, layers, encoding)


def _add_layers(path: Path, dataset: "xr.Dataset", layers: Mapping[str, Any], encoding: Mapping[str, Any]) -> None:
    import warnings

    warnings.filterwarnings("ignore", "Consolidated metadata is currently not part in the Zarr format 3")
    dataset[list(layers)].reset_coords(drop=True).to_zarr(
        path, mode="a", zarr_format=3, consolidated=True, encoding=dict(encoding), compute=False
    )


def write_block(path: Path, layers: Mapping[str, NDArray[Any]], place: tuple[Any, ...]) -> None:
    """Put the layers of one block at `place` (an index or slice for each dimension): whole files of the group, for
    whoever writes a part of one reads and writes all of it, and of two at once one is lost."""
    import zarr

    group = zarr.open_group(str(path), mode="r+")
    for name, values in layers.items():
        array = group[name]
        if not isinstance(array, zarr.Array):
            raise ValueError(f"{name} of {path} is no array")
        array[place] = values
