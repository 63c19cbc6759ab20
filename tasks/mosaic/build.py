"""A mosaic from a store: law and levels from all images, then the map block by block, on Dask."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.target import Target
from tasks.atomic import folder_put_in_place
from tasks.mosaic.block import combined_block
from tasks.mosaic.grid import Block, MosaicGrid, block_side, blocks_in, blocks_per_file, mosaic_grid
from tasks.mosaic.model import Model, solve_model
from tasks.mosaic.samples import samples_of
from tasks.mosaic.settings import MosaicSettings, pixel_size_km
from tasks.mosaic.variables import map_variables
from tasks.mosaic.view import COVERAGE_SHAPE, View, load_view
from tasks.photometry.laws import IMAGE_UNITS, RADIANCE_FACTOR
from tasks.photometry.region import each_taken, refuse_several, unreadable_products, usable_products
from tasks.project.points import latitude_longitude
from tasks.publish.cube import crs_attributes, software_version
from tasks.publish.map_store import create_map, write_block

GRID_MAPPING = "crs"
ALL = "all"


@dataclass(frozen=True)
class Member:
    """One image of a mosaic. folder: of the product; coverage: see `tasks.mosaic.view.View`."""

    product: str
    folder: Path
    band: str
    coverage: NDArray[np.bool_]
    utc_et: float


@dataclass(frozen=True)
class Mosaic:
    """What a mosaic is made of, and where it was written. members: its images, whose place is their number; models: law
    and levels of each band, in the order of its members; left_out: products that could not be used, and why."""

    path: Path
    target: Target
    grid: MosaicGrid
    settings: MosaicSettings
    members: tuple[Member, ...]
    models: dict[str, Model]
    left_out: tuple[tuple[str, str], ...]

    @property
    def unit(self) -> str:
        """What the reflectance is counted in."""
        return RADIANCE_FACTOR if self.settings.units_per_if else f"{IMAGE_UNITS} of an image of level 1"

    def numbers_in(self, band: str) -> list[int]:
        """Numbers of the members of a band."""
        return [number for number, member in enumerate(self.members) if member.band == band]


def build_mosaic(
    store: Path, out: Path, settings: MosaicSettings, say: Callable[[str], None] = lambda _: None
) -> Mosaic:
    """Write the mosaic of `store` as a Zarr group `out`, all or nothing, and return what it is made of. Blocks are made
    by Dask: on the cluster of the current client where there is one, else in threads of this process.

    Raises RefusedError when the store has no usable image, images of several bodies, or none that shows lit ground
    within the limits; WrongOptionError for a resolution that is none.
    """
    folders, broken = usable_products(store, settings.doubtful), unreadable_products(store)
    members, target, left_out = _members(folders, settings)
    pixel_km = pixel_size_km(settings.resolution, target)
    models = {}
    for band in sorted({member.band for member in members}):
        views = [load_view(member.folder) for member in members if member.band == band]
        models[band] = solve_model(samples_of(views, settings), settings)
        say(f"{band}: {len(views)} images, {models[band].law.name}, law and levels from {models[band].samples} samples")
    nearest = load_view(members[0].folder).pose.spacecraft_in_body_km
    centre = tuple(float(angle) for angle in latitude_longitude(nearest))
    grid = mosaic_grid(settings.projection, target, pixel_km, (centre[0], centre[1]), settings.central_longitude_deg)
    mosaic = Mosaic(Path(out), target, grid, settings, tuple(members), models, (*broken, *left_out))
    with folder_put_in_place(Path(out)) as temporary:
        temporary.rmdir()
        _write(mosaic, temporary)
    return mosaic


def _members(folders: Sequence[Path], settings: MosaicSettings) -> tuple[list[Member], Target, list[tuple[str, str]]]:
    members: list[Member] = []
    left_out: list[tuple[str, str]] = []
    targets: dict[str, Target] = {}

    def take(folder: Path) -> None:
        view = load_view(folder)
        targets[view.target.name] = view.target
        band = {"filter": view.filter, "camera": view.camera.name}.get(settings.bands, ALL)
        members.append(Member(view.product, folder, band, view.coverage, view.pose.et))

    left_out += each_taken(folders, take)
    refuse_several(targets)
    if not members:
        raise RefusedError(Reason.NO_USABLE_IMAGE, f"none of {len(folders)} images can be read.", left_out[0][1])
    return members, next(iter(targets.values())), left_out


def _write(mosaic: Mosaic, path: Path) -> None:
    import dask

    bands = sorted(mosaic.models)
    many = mosaic.settings.bands != "none"
    memory_mb = mosaic.settings.memory_mb
    side = block_side(max(len(mosaic.numbers_in(band)) for band in bands), memory_mb)
    several = blocks_per_file(mosaic.grid.shape, side, memory_mb)
    _create(mosaic, path, bands if many else None, side, several)
    work = [
        dask.delayed(_make_file)(mosaic, band, place, side, path, (number,) if many else ())
        for number, band in enumerate(bands)
        for place in mosaic.grid.blocks(side * several)
    ]
    dask.compute(*work)


def _make_file(mosaic: Mosaic, band: str, place: Block, side: int, path: Path, before: tuple[int, ...]) -> None:
    """Make the blocks of one file and write it, in one go: two who write into a shard would lose each other's blocks.
    place: of the file, in the map. before: the place along further dimensions."""
    layers: dict[str, NDArray[Any]] = {}
    for block in blocks_in(place, side):
        for name, values in _made_block(mosaic, band, block).items():
            if name not in layers:
                layers[name] = np.empty([part.stop - part.start for part in place], values.dtype)
            inside = tuple(slice(b.start - p.start, b.stop - p.start) for b, p in zip(block, place, strict=True))
            layers[name][inside] = values
    write_block(path, layers, (*before, *place))


def _made_block(mosaic: Mosaic, band: str, block: Block) -> dict[str, NDArray[Any]]:
    """The layers of one block."""
    latitude, longitude = mosaic.grid.places(block)
    cells = cells_of(latitude, longitude)
    numbers = mosaic.numbers_in(band)
    shown = [number for number in numbers if mosaic.members[number].coverage[cells].any()]
    views: list[tuple[int, View]] = [(numbers.index(n), load_view(mosaic.members[n].folder)) for n in shown]
    layers = combined_block(
        latitude, longitude, views, mosaic.models[band], mosaic.settings, mosaic.grid.pixel_km
    )  # numbers within the band
    index = layers["image_index"]
    layers["image_index"] = np.where(index >= 0, np.asarray(numbers, np.int16)[index], index).astype(np.int16)
    return layers


def cells_of(latitude: NDArray[np.float64], longitude: NDArray[np.float64]) -> tuple[NDArray[np.intp], ...]:
    """Rows and columns of the cells of `Member.coverage` in which known places lie."""
    rows, columns = COVERAGE_SHAPE
    known = np.isfinite(latitude)
    row = np.clip((90 - latitude[known]) * rows / 180, 0, rows - 1).astype(np.intp)
    return row, np.clip(longitude[known] * columns / 360, 0, columns - 1).astype(np.intp)


def _create(mosaic: Mosaic, path: Path, bands: list[str] | None, side: int, several: int) -> None:
    """The empty map with its coordinates; several: blocks of a file along each axis."""
    grid, target = mosaic.grid, mosaic.target
    if grid.equirectangular:
        dims: tuple[str, ...] = ("lat", "lon")
        north = _axis("latitude", "degrees_north", "planetocentric latitude", "Y")
        east = _axis("longitude", "degrees_east", "longitude, positive eastward", "X")
        coordinates: dict[str, Any] = {
            "lat": ("lat", grid.latitude(), {**north, "bounds": "lat_bnds"}),
            "lon": ("lon", grid.longitude(), {**east, "bounds": "lon_bnds"}),
        }
        bounds = {f"{axis}_bnds": ((axis, "bnds"), _bounds(coordinates[axis][1])) for axis in dims}
        crs = crs_attributes(target)
    else:
        dims = ("y", "x")
        coordinates = {
            axis: (axis, values, _axis(f"projection_{axis}_coordinate", "m", f"{axis} of the map", axis.upper()))
            for axis, values in (("y", grid.grid.y_m()), ("x", grid.grid.x_m()))
        }
        bounds = {}
        crs = dict(grid.grid.projection.crs.to_cf())
    chunks: tuple[int, ...] = tuple(min(side, n) for n in grid.shape)
    shards: tuple[int, ...] = tuple(several * chunk for chunk in chunks)
    if bands is not None:
        dims, chunks, shards = ("band", *dims), (1, *chunks), (1, *shards)
        coordinates["band"] = ("band", np.arange(len(bands), dtype=np.int16), {"long_name": "band", "bands": bands})
    transform = " ".join(repr(value) for value in grid.geo_transform())
    levels, sigmas = np.ones(len(mosaic.members)), np.zeros(len(mosaic.members))
    for band, model in mosaic.models.items():
        numbers = mosaic.numbers_in(band)
        levels[numbers], sigmas[numbers] = model.levels, model.level_sigma
    extra: dict[str, Any] = {
        **bounds,
        GRID_MAPPING: ((), np.int32(0), {**crs, "GeoTransform": transform}),
        "level": ("image", levels, {"long_name": "brightness of an image against the others", "units": "1"}),
        "level_sigma": ("image", sigmas, {"long_name": "1-sigma of level, relative", "units": "1"}),
    }
    variables = map_variables(dims, "1", GRID_MAPPING)
    create_map(path, variables, coordinates, (chunks, shards), _attributes(mosaic), extra)


def _axis(standard_name: str, units: str, long_name: str, axis: str) -> dict[str, str]:
    return {"standard_name": standard_name, "units": units, "long_name": long_name, "axis": axis}


def _bounds(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Limits (n, 2) of evenly spaced cells, in the order of their centres."""
    half = (centres[-1] - centres[0]) / (2 * max(len(centres) - 1, 1))
    return np.stack([centres - half, centres + half], axis=1)


def _attributes(mosaic: Mosaic) -> dict[str, Any]:
    chosen = mosaic.settings
    laws = {
        band: {"parameters": model.values, "sigma": model.sigma, "scatter": model.scatter, "samples": model.samples}
        for band, model in mosaic.models.items()
    }
    return {
        "title": f"Normalised reflectance of {mosaic.target.name}",
        "coordinates": GRID_MAPPING,  # as xarray names coordinates without a dimension: rioxarray looks for it there
        "source": f"planetpose {software_version()}",
        "target": mosaic.target.name,
        "law": chosen.law,
        "reflectance_unit": mosaic.unit,
        "standard_incidence_emission_phase_deg": list(chosen.standard_deg),
        "max_incidence_deg": chosen.max_incidence_deg,
        "max_emission_deg": chosen.max_emission_deg,
        "weights": chosen.weights,
        "projection": chosen.projection,
        "pixel_km": mosaic.grid.pixel_km,
        "products": [member.product for member in mosaic.members],
        "laws": json.dumps(laws),
    }
