"""Cubes and stores as xarray objects, with the accessor `cube.planetpose`."""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from tasks.publish.cube import open_cube as open_plain_cube
from tasks.publish.index import open_store as open_plain_store

if TYPE_CHECKING:
    import xarray as xr

ACCESSOR = "planetpose.accessor"


def open_cube(path: Path | str) -> "xr.Dataset":
    """Open a cube lazily, as dask arrays; a path, or a URL that fsspec understands. The dataset has the accessor
    `cube.planetpose` (see `CubeAccessor`).

    Raises RefusedError when something in it is a link that leads out of its store, or no file, or when it is damaged.
    """
    import_module(ACCESSOR)  # registers it
    return open_plain_cube(path)


def open_store(store: Path) -> "xr.DataTree":
    """All cubes of a store as one tree, one node per product, lazy: dask arrays. Raises RefusedError when there is no
    store."""
    import_module(ACCESSOR)  # registers it
    return open_plain_store(store)
