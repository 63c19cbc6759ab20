"""The xarray accessor `cube.planetpose`: places, pictures and maps of one cube.

It is there once a cube was opened by `planetpose.open_cube`; for datasets that xarray itself opens:

    import planetpose.accessor, xarray
    cube = xarray.open_zarr("out/C0552809300R/cube.zarr")
    x, y = cube.planetpose.pixel_of(12.5, 271.0)
"""

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from planetpose.geometry import pixel_of, place_of
from tasks.position.model import PositionModel, position_model
from tasks.position.position import Position, positions_of_pixels, positions_of_places
from tasks.publish.cube_model import CubeModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
LAYERS = ("limb", "grid", "terminator")


@xr.register_dataset_accessor("planetpose")
class CubeAccessor:
    """What a cube knows beyond its planes. Pixels are those of the cube, 0-based, integer at the centre, y down;
    latitudes are planetocentric, longitudes east, degrees. Raises RefusedError where the dataset is no cube."""

    def __init__(self, cube: xr.Dataset) -> None:
        self._cube = cube

    @cached_property
    def _positions(self) -> PositionModel:
        return position_model(self._cube)

    @property
    def model(self) -> CubeModel:
        """Pose, camera and target."""
        return self._positions.geometry

    def pixel_of(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> tuple[Array, Array]:
        """Where places are in the image, (x, y); NaN where it does not see them. See `planetpose.pixel_of`."""
        return pixel_of(self.model, latitude_deg, longitude_deg)

    def place_of(self, x_px: ArrayLike, y_px: ArrayLike) -> tuple[Array, Array]:
        """What pixels see, (latitude, longitude); NaN off the body. See `planetpose.place_of`."""
        return place_of(self.model, x_px, y_px)

    def at(self, x_px: ArrayLike, y_px: ArrayLike) -> list[Position]:
        """What pixels see with sigmas and in words, as `planetpose at` prints it."""
        x, y = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (x_px, y_px)))
        return positions_of_pixels(self._positions, np.stack([x.ravel(), y.ravel()], axis=-1))

    def at_place(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> list[Position]:
        """Where places are in the image with sigmas and in words, as `planetpose at --place` prints it."""
        latitude, longitude = np.broadcast_arrays(latitude_deg, longitude_deg)
        return positions_of_places(self._positions, latitude.ravel(), longitude.ravel())

    def uncertainty_parts(self, name: str) -> xr.Dataset:
        """What `latitude_uncertainty` or `longitude_uncertainty` is made of: variables `pose`, `distortion` and
        `map_frame` (1-sigma, degrees), whose squares add up to its square. name: `latitude` or `longitude`, or the
        name of the uncertainty. Raises ValueError for another name."""
        from tasks.project.more_planes import SIGMA_PARTS
        from tasks.publish.extra_planes import extra_dataset

        coordinate = name.removesuffix("_uncertainty")
        parts = {full: each.part for full, each in SIGMA_PARTS.items() if each.coordinate == coordinate}
        if not parts:
            raise ValueError(f"{name!r} is neither latitude nor longitude")
        return extra_dataset(self._cube, tuple(parts)).rename(parts)

    def plot(
        self, name: str = "image", layers: tuple[str, ...] = LAYERS, axes: "Axes | None" = None, **imshow: Any
    ) -> "Axes":
        """Draw a plane with curves over it and return matplotlib's axes. name: a variable of the cube; layers: some of
        limb, grid, terminator. imshow: passed on to matplotlib. Raises RefusedError for a variable that is not there,
        ValueError for an unknown layer."""
        from planetpose.pictures import draw_plane

        if name not in self._cube:
            known = ", ".join(str(each) for each in self._cube.variables if self._cube[each].ndim == 2)
            raise RefusedError(Reason.PARAMETERS_INVALID, f"the cube has no {name!r}.", f"It has {known}.")
        unknown = set(layers) - set(LAYERS)
        if unknown:
            raise ValueError(f"no layer {', '.join(sorted(unknown))}; known are {', '.join(LAYERS)}")
        return draw_plane(self._cube, self.model, name, layers, axes, imshow)

    def to_map(
        self,
        projection: str = "equirectangular",
        resolution_km: float | None = None,
        central_longitude_deg: float | None = None,
        kernel: str = "bilinear",
        max_emission_deg: float = 85.0,
    ) -> xr.Dataset:
        """Image, angles, coordinates, their errors and flags on a map, as `planetpose export --format zarr-map` writes
        them: variables over (y, x) in metres, with a CF grid mapping.

        projection: equirectangular, orthographic or polar-stereographic. resolution_km: side of a pixel (default: the
        image's). kernel: nearest, bilinear or cubic. Raises RefusedError as `planetpose export` does.
        """
        from tasks.export.map_image import map_image
        from tasks.export.source import Source
        from tasks.export.zarr_map import map_dataset

        known, cube = self.model, self._cube.load()
        product = str(cube.attrs.get("product", ""))
        source = Source(product, Path(product), cube, known.pose, known.camera, known.target)
        how = (projection, resolution_km, central_longitude_deg, kernel, max_emission_deg)
        return map_dataset(source, map_image(source, *how))
