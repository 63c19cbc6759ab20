"""Planes of products as arrays, and their tiles for deep zoom; the latest ones stay in memory, up to a limit."""

import threading
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError, RefusedError
from catalog.reasons import Reason
from tasks.diagnose.failed_folder import FRAME, failed_folder
from tasks.publish.contained import reading_product
from tasks.publish.cube import open_cube, plane_values
from tasks.publish.extra_planes import EXTRA
from tasks.publish.names import CUBE

if TYPE_CHECKING:
    import xarray as xr

    from tasks.pictures.product import Product

Plane = NDArray[np.float32]

TILE_PX = 512
OPENING_PX = 1024
MEMORY_BYTES = 64_000_000
OPEN_CUBES = 4
NEAREST = ("quality", "longitude")  # a mean of flags, or over the end of a circle, means nothing
# Made from the product's scene when they are wanted; the pose that they are of.
SIMULATED = {
    "simulation": "after",
    "residual": "after",
    "simulation_predicted": "before",
    "residual_predicted": "before",
}


class Planes:
    """Planes of one store's products, by name."""

    def __init__(self, store: Path, tile_px: int = TILE_PX) -> None:
        self.store, self.tile_px = Path(store), tile_px
        self._lock = threading.RLock()
        self.simulating = threading.Lock()
        self._cubes: OrderedDict[str, xr.Dataset] = OrderedDict()
        self._planes: OrderedDict[tuple[str, str, int], Plane] = OrderedDict()

    def cube(self, product: str) -> "xr.Dataset":
        """The open cube, lazy. Raises RefusedError when there is none, or it is damaged."""
        with self._lock:
            if product in self._cubes:
                self._cubes.move_to_end(product)
                return self._cubes[product]
            path = self.place(product)
            if path is None:
                raise RefusedError(Reason.PRODUCT_MISSING, f"{product} has no {CUBE}.", "See its reason in the table.")
            self._cubes[product] = open_cube(path, chunked=False)
            while len(self._cubes) > OPEN_CUBES:
                self._cubes.popitem(last=False)[1].close()
            return self._cubes[product]

    def place(self, product: str) -> Path | None:
        """The product's cube, or the frame that a failed image left; None where there is neither."""
        failed = failed_folder(self.store, product)
        return next((path for path in (self.store / product / CUBE, failed / FRAME) if path.is_dir()), None)

    def version(self, product: str) -> str:
        """Another text whenever the product was exchanged; empty where there is none."""
        place = self.place(product)
        return "" if place is None else str(place.stat().st_mtime_ns)

    def has_product(self, product: str) -> bool:
        """Whether there is a cube; a failed image has its frame alone."""
        return (self.store / product / CUBE).is_dir()

    def forget(self, product: str) -> None:
        """Read the product anew when it is wanted: it was exchanged."""
        with self._lock:
            cube = self._cubes.pop(product, None)
            if cube is not None:
                cube.close()
            for key in [key for key in self._planes if key[0] == product]:
                del self._planes[key]

    def plane(self, product: str, name: str, level: int = 0) -> Plane:
        """A plane (ny, nx), float32, NaN where nothing is known; of level n reduced by 2**n. Raises RefusedError for a
        plane that is not there or cannot be made."""
        key = (product, name, level)
        with self._lock:
            if key in self._planes:
                self._planes.move_to_end(key)
                return self._planes[key]
        if level > 0:
            found = reduced(self.plane(product, name, level - 1), name in NEAREST)
        elif name in SIMULATED:
            with self.simulating:
                found = self._simulated(product, name)
        else:
            found = self._read(product, name)
        with self._lock:
            self._planes[key] = found
            while sum(each.nbytes for each in self._planes.values()) > MEMORY_BYTES and len(self._planes) > 1:
                self._planes.popitem(last=False)
        return found

    def tile(self, product: str, name: str, level: int, column: int, row: int) -> bytes:
        """A tile's values as little-endian float32, row by row; its size follows from the plane's. Raises RefusedError
        for a tile outside of the plane."""
        plane = self.plane(product, name, level)
        side = self.tile_px
        part = plane[row * side : (row + 1) * side, column * side : (column + 1) * side]
        if min(row, column) < 0 or not part.size:
            raise RefusedError(Reason.PARAMETERS_INVALID, f"there is no tile {column}, {row}.", "")
        return np.ascontiguousarray(part, dtype="<f4").tobytes()

    def tiles(self, product: str, name: str, level: int) -> bytes:
        """All tiles of a level, one after the other, row by row."""
        places = tile_places(self.plane(product, name, level).shape, self.tile_px)
        return b"".join(self.tile(product, name, level, column, row) for column, row in places)

    def names(self, product: str) -> list[dict[str, Any]]:
        """Name, long name and units of every plane of the image's size."""
        cube, extra = self.cube(product), self._extra(product)
        shape = cube["image"].shape
        variables = {str(name): cube[name] for name in cube.variables if cube[name].shape == shape}
        variables |= {str(name): extra[name] for name in extra.data_vars} if extra is not None else {}
        found = [
            {"name": name, "long_name": array.attrs.get("long_name", name), "units": array.attrs.get("units", "1")}
            for name, array in variables.items()
        ]
        return found + [
            {"name": name, "long_name": name.replace("_", ", "), "units": "1"} for name in SIMULATED
        ]  # fmt: skip

    def _extra(self, product: str) -> "xr.Dataset | None":
        folder = self.store / product / EXTRA
        return open_cube(folder, chunked=False) if folder.is_dir() else None

    def _read(self, product: str, name: str) -> Plane:
        cube = self.cube(product)
        source: Any = cube if name in cube.variables else self._extra(product)
        if source is None or name not in source.variables or source[name].shape != cube["image"].shape:
            known = ", ".join(each["name"] for each in self.names(product))
            raise RefusedError(Reason.PLANE_UNKNOWN, f"{product} has no plane {name!r}.", f"It has {known}.")
        return np.asarray(plane_values(source, name), dtype=np.float32)

    def _simulated(self, product: str, name: str) -> Plane:
        """The simulation in the image's unit, or the residual relative to the disk's bright parts."""
        from tasks.pictures.residual_figure import residual_of

        read = self.scene_of(product)
        found = residual_of(read, getattr(read, SIMULATED[name]))
        if found is None:
            fault = f"the simulation of {product} shows nothing under this pose."
            raise FailedError(Reason.NO_USABLE_PIXELS, fault, "Look at the limbs instead.")
        values = found.relative if name.startswith("residual") else found.model
        whole = np.full(read.observation.image.shape, np.nan, np.float32)
        x0, y0 = found.origin
        rows, columns = values.shape
        inside = np.s_[max(y0, 0) : y0 + rows, max(x0, 0) : x0 + columns]
        clipped = values[max(-y0, 0) :, max(-x0, 0) :]
        target = whole[inside]
        target[...] = clipped[: target.shape[0], : target.shape[1]]
        return self._on_image(product, whole)

    def scene_of(self, product: str) -> "Product":
        """Observation, scene and poses of a product or a failed image. Raises RefusedError, as `cube` does and where
        the base map is not at hand."""
        from tasks.pictures.product import product_in, read_product

        path = self.place(product)
        if path is None or path.name == CUBE:
            return read_product(self.store / product)
        with reading_product(path.parent):
            return product_in(path.parent, path.name)

    def _on_image(self, product: str, undistorted: Plane) -> Plane:
        """A plane of the undistorted frame at the image's pixels, which may be the detector's own."""
        cube = self.cube(product)
        if "place_x" not in cube:
            return undistorted
        import cv2

        x, y = (np.asarray(plane_values(cube, each), dtype=np.float32) for each in ("place_x", "place_y"))
        found = cv2.remap(undistorted, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=np.nan)
        return np.asarray(found, dtype=np.float32)


def reduced(plane: Plane, nearest: bool) -> Plane:
    """Half the size: means of what is known in 2 x 2 pixels, or one of them."""
    if nearest:
        return np.ascontiguousarray(plane[::2, ::2])
    ny, nx = plane.shape
    if ny % 2 or nx % 2:
        plane = np.pad(plane, ((0, ny % 2), (0, nx % 2)), constant_values=np.nan)
    squares = [plane[row::2, column::2] for row in (0, 1) for column in (0, 1)]
    found: Plane = (squares[0] + squares[1] + squares[2] + squares[3]) * np.float32(0.25)
    partly = ~np.isfinite(found)
    if partly.any():
        four = np.stack([square[partly] for square in squares])
        known = np.isfinite(four)
        count = known.sum(axis=0)
        total = np.where(known, four, 0).sum(axis=0, dtype=np.float64)
        found[partly] = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return found


def opening_level(shape: tuple[int, int]) -> int:
    """The finest level whose sides are OPENING_PX at most: what a frame of usual size is looked at first."""
    level, size = 0, max(shape)
    while size > OPENING_PX:
        size, level = (size + 1) // 2, level + 1
    return level


def levels_of(shape: tuple[int, int], tile_px: int = TILE_PX) -> int:
    """How many levels there are until the whole plane is one tile."""
    levels, size = 1, max(shape)
    while size > tile_px:
        size, levels = (size + 1) // 2, levels + 1
    return levels


def tile_places(shape: tuple[int, ...], tile_px: int = TILE_PX) -> Iterator[tuple[int, int]]:
    """(column, row) of every tile of a plane (ny, nx), row by row."""
    for row in range(-(-shape[0] // tile_px)):
        for column in range(-(-shape[1] // tile_px)):
            yield column, row
