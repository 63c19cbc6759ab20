"""The pixels of one region, gathered over all images of a store."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import BaseMap
from catalog.errors import RefusedError
from catalog.observation import UNUSABLE, Quality
from catalog.plain_text import printable
from catalog.reasons import Reason
from tasks.boundary import reason_of, trouble_of
from tasks.export.pixels import Selection, pixel_table
from tasks.export.source import Source, read_source
from tasks.geometry.bilinear import map_values
from tasks.photometry.errors import brightness_errors
from tasks.pictures.product import map_of_product
from tasks.publish.index import open_index
from tasks.publish.index_rows import UNREADABLE

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
# Patches of ground whose pixels err together, degrees: of large regions, and at least. A small region is cut into about
# PATCHES of them: of an area of ten degrees one patch would leave nothing to compare.
TILE_DEG, LEAST_TILE_DEG = 10.0, 1.0
PATCHES = 25
FEWEST_PIXELS = 20
FEWEST_SKY_PIXELS = 100
USED = ("ok",)


@dataclass(frozen=True)
class RegionPixels:
    """n pixels of one region. products: names of the images that see it. image (n,): which of them; value: brightness
    above the sky's; mu0, mu: cosines of incidence and emission; phase_deg; albedo: relative, of the base map, or 1;
    tile: the patch of ground, counted over all images. seen: pixels per image before they were thinned out. noise (n,):
    1-sigma of the brightness by noise and pose, None where nobody knows it. latitude, longitude (n,): planetocentric,
    east, degrees; None where nobody needs them."""

    products: tuple[str, ...]
    image: NDArray[np.intp]
    value: Array
    mu0: Array
    mu: Array
    phase_deg: Array
    albedo: Array
    tile: NDArray[np.intp]
    seen: tuple[int, ...]
    noise: Array | None = None
    latitude: Array | None = None
    longitude: Array | None = None

    def mean_phase_deg(self, image: int) -> float:
        """Mean phase of one image's pixels."""
        return float(self.phase_deg[self.image == image].mean())


def unreadable_products(store: Path) -> tuple[tuple[str, str], ...]:
    """Products of a store that its index could not read, and why."""
    from tasks.publish.names import CUBE

    if (Path(store) / CUBE).is_dir():
        return ()
    index = open_index(Path(store))
    broken = index[index["status"] == UNREADABLE]
    return tuple(zip(broken["product"], broken["reason"], strict=True))


@dataclass(frozen=True)
class OneImage:
    """What one product adds to a region. columns: fields of `RegionPixels`. seen: pixels before they were thinned."""

    product: str
    target: str
    columns: dict[str, NDArray]
    seen: int


Attempt = Callable[[Path, Callable[[], OneImage | None]], OneImage | None]


def usable_products(store: Path, doubtful: bool = False) -> list[Path]:
    """Folders of a store's products whose verdict is ok, or a product's own folder. Raises RefusedError when none."""
    from tasks.publish.names import CUBE

    store = Path(store)
    if (store / CUBE).is_dir():
        return [store]
    index = open_index(store)
    wanted = index[index["status"].isin((*USED, "doubtful") if doubtful else USED)]
    if wanted.empty:
        found = ", ".join(f"{n} {status}" for status, n in index["status"].value_counts().items()) or "nothing"
        raise RefusedError(
            Reason.NO_USABLE_IMAGE,
            f"{store} holds no image whose geometry is ok ({found}).",
            "Look at `planetpose index`; `--doubtful` takes doubtful ones too.",
        )
    return [store / product for product in wanted["product"]]


def region_pixels(
    folders: Sequence[Path],
    selection: Selection,
    max_pixels_per_image: int = 5_000,
    albedo_map: bool = False,
    attempt: Attempt = lambda folder, gather: gather(),  # noqa: ARG005
) -> RegionPixels:
    """Gather the selected, unflagged pixels of all products; of an image with more than `max_pixels_per_image` every
    k-th. albedo_map: divide out the base map that the products were made with. attempt: gathers one product's pixels
    by the function it is given; None leaves the product out.

    Raises RefusedError when no image sees the region with at least 20 pixels, the products are of different targets,
    or the base map is not at hand.
    """
    products: list[str] = []
    parts: list[dict[str, NDArray]] = []
    seen: list[int] = []
    targets: set[str] = set()
    for folder in folders:
        gathered = attempt(folder, partial(_of_one, folder, selection, max_pixels_per_image, albedo_map))
        if gathered is None:
            continue
        targets.add(gathered.target)
        if len(targets) > 1:
            raise RefusedError(
                Reason.TARGETS_DIFFER, f"the images show {' and '.join(sorted(targets))}.", "Give one body's."
            )
        count = len(gathered.columns["value"])
        parts.append(gathered.columns | {"image": np.full(count, len(products))})
        products.append(gathered.product)
        seen.append(gathered.seen)
    if not products:
        raise RefusedError(
            Reason.REGION_UNSEEN,
            f"none of {len(folders)} images has {FEWEST_PIXELS} usable pixels of the region within the limits.",
            "Widen the region or the limits of the angles.",
        )
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    columns["tile"] = ground_patches(columns["latitude"], columns["longitude"])
    mapped = columns["albedo"] > 0
    return RegionPixels(tuple(products), seen=tuple(seen), **{name: each[mapped] for name, each in columns.items()})


def _of_one(folder: Path, selection: Selection, max_pixels: int, albedo_map: bool) -> OneImage | None:
    """The pixels of one product; None when it sees too little of the region."""
    source = read_source(folder)
    table = pixel_table(source, selection)
    table = table[np.isfinite(table["image"])]
    if len(table) < FEWEST_PIXELS:
        return None
    thinned = table.iloc[:: -(-len(table) // max_pixels)]
    columns = _columns(source, thinned, albedo_map)
    return OneImage(source.product, source.target.name, columns, len(table))


def _columns(source: Source, table: "pd.DataFrame", albedo_map: bool) -> dict[str, NDArray]:
    """Fields of `RegionPixels` for the pixels in `table`, but for their patch of ground."""
    names = ("image", "incidence", "emission", "phase", "latitude", "longitude")
    value, incidence, emission, phase, latitude, longitude = (table[name].to_numpy(np.float64) for name in names)
    albedo = np.ones_like(value)
    if albedo_map:
        basemap = _map_as_coarse_as_pixels(source)
        albedo = map_values(basemap.albedo, basemap.left_edge_deg, latitude, longitude)
    return {
        "value": value - sky_level(source),
        "mu0": np.cos(np.radians(incidence)),
        "mu": np.cos(np.radians(emission)),
        "phase_deg": phase,
        "albedo": albedo,
        "noise": _noise_at(source, table),
        "latitude": latitude,
        "longitude": longitude,
    }


def _noise_at(source: Source, table: "pd.DataFrame") -> Array:
    """1-sigma of the brightness of the pixels in `table`, noise and pose together."""
    errors = brightness_errors(source)
    places = table["y"].to_numpy(), table["x"].to_numpy()
    return np.hypot(errors.noise[places], errors.pose[places]).astype(np.float64)


def ground_patches(latitude: Array, longitude: Array) -> NDArray[np.intp]:
    """A number for each patch of ground: about PATCHES of the region that the places fill, of 1 to 10 degrees."""
    cells = len(np.unique(_tiles(latitude, longitude, LEAST_TILE_DEG)))
    side = LEAST_TILE_DEG * np.sqrt(cells / PATCHES)
    return _tiles(latitude, longitude, float(np.clip(side, LEAST_TILE_DEG, TILE_DEG)))


def _tiles(latitude: Array, longitude: Array, tile_deg: float) -> NDArray[np.intp]:
    """Rows of `tile_deg`, patches about as wide as high."""
    row = np.floor((latitude + 90) / tile_deg)
    width = tile_deg / np.maximum(np.cos(np.radians((row + 0.5) * tile_deg - 90)), 0.02)
    return (row * 1000 + np.floor(longitude / width)).astype(np.intp)


def sky_level(source: Source) -> float:
    """Median of the usable pixels off the body and away from its limb: dark current, bias, stray light. 0 when the
    frame shows too little sky."""
    quality = source.cube["quality"].values
    sky = ((quality & np.uint16(Quality.OFF_BODY)) != 0) & ((quality & np.uint16(UNUSABLE | Quality.LIMB)) == 0)
    values = source.cube["image"].values[sky]
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size >= FEWEST_SKY_PIXELS else 0.0


def _map_as_coarse_as_pixels(source: Source) -> BaseMap:
    """The base map averaged to what a pixel sees."""
    from tasks.simulate.coarse_map import map_as_coarse_as

    provenance = json.loads(source.attributes["provenance"])
    basemap = map_of_product(provenance.get("basemap", {}), source.target, None, source.folder)
    pixel_rad = float(np.nanmin(source.cube["resolution_km"].values)) / source.target.mean_radius_km
    return replace(basemap, albedo=map_as_coarse_as(basemap, pixel_rad))


def each_taken(folders: Iterable[Path], take: Callable[[Path], None]) -> list[tuple[str, str]]:
    """Do `take` for every product's folder; names and reasons of those that it could not be done for."""
    left_out = []
    for folder in folders:
        error = trouble_of(lambda folder=folder: take(folder), folder.name)  # type: ignore[misc]
        if error is not None:
            left_out.append((printable(folder.name), reason_of(error)))
    return left_out


def refuse_several(targets: Iterable[str]) -> None:
    """Raise RefusedError where products show more than one target."""
    names = sorted(set(targets))
    if len(names) > 1:
        raise RefusedError(Reason.TARGETS_DIFFER, f"the images show {' and '.join(names)}.", "Give one body's.")
