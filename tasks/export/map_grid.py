"""Map projections and their grids: which place on the body each pixel of a map is.

Maps are made on the sphere of the body's IAU_2015 code, with planetocentric latitude and east longitude, as that code
defines them; x and y are metres on that sphere. Projections and WKT are pyproj's.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.target import Target

if TYPE_CHECKING:
    from affine import Affine
    from pyproj import CRS, Transformer

Array = NDArray[np.float64]
PROJECTIONS = ("equirectangular", "orthographic", "polar-stereographic")
LARGEST_SIDE_PX = 32_000  # OpenCV's remap counts in 16 bits
Bounds = tuple[float, float, float, float]


@dataclass(frozen=True)
class MapProjection:
    """One projection of one body. extent_m: (x0, y0, x1, y1) of all that it can show; step_m: pixel size."""

    name: str
    crs: "CRS"
    extent_m: Bounds
    step_m: float

    def latitude_longitude(self, x_m: Array, y_m: Array) -> tuple[Array, Array]:
        """Planetocentric latitude and east longitude, degrees, of places on the map; NaN where it shows nothing."""
        longitude, latitude = _finite_or_nan(self._to_body().transform(x_m, y_m))
        return latitude, longitude % 360.0

    def map_place(self, latitude_deg: Array, longitude_deg: Array) -> tuple[Array, Array]:
        """x and y, metres, of places on the body; NaN where the projection cannot show them."""
        from pyproj.enums import TransformDirection

        places = self._to_body().transform(longitude_deg, latitude_deg, direction=TransformDirection.INVERSE)
        x, y = _finite_or_nan(places)
        return x, y

    def _to_body(self) -> "Transformer":
        from pyproj import Transformer

        return Transformer.from_crs(self.crs, self.crs.geodetic_crs, always_xy=True)


@dataclass(frozen=True)
class MapGrid:
    """Pixels of a map: columns eastward or to the right from x0_m, rows downward from y0_m (outer corner)."""

    projection: MapProjection
    x0_m: float
    y0_m: float
    shape: tuple[int, int]

    @property
    def step_m(self) -> float:
        """Side of a pixel."""
        return self.projection.step_m

    @property
    def transform(self) -> "Affine":
        """From (column, row), corners of pixels, to (x, y)."""
        from affine import Affine

        return Affine(self.step_m, 0.0, self.x0_m, 0.0, -self.step_m, self.y0_m)

    def x_m(self, per_pixel: int = 1) -> Array:
        """x of the centres of columns, or of `per_pixel` parts of each."""
        centres: Array = np.arange(self.shape[1] * per_pixel, dtype=np.float64) + 0.5
        return self.x0_m + centres * (self.step_m / per_pixel)

    def y_m(self, per_pixel: int = 1) -> Array:
        """y of the centres of rows, or of `per_pixel` parts of each."""
        centres: Array = np.arange(self.shape[0] * per_pixel, dtype=np.float64) + 0.5
        return self.y0_m - centres * (self.step_m / per_pixel)


def _finite_or_nan(pair: tuple[Array, Array]) -> Array:
    """Two coordinates (2, ...), both NaN where either is infinite, which is PROJ's word for nowhere."""
    values: Array = np.stack([np.asarray(part, dtype=np.float64) for part in pair])
    values[:, ~np.isfinite(values).all(axis=0)] = np.nan
    return values


def body_crs(target: Target) -> "CRS":
    """Planetocentric coordinates on the body's sphere: its IAU_2015 code, else a sphere of its mean radius."""
    from pyproj import CRS

    if target.iau_crs:
        return CRS.from_user_input(target.iau_crs)
    name, radius_m = target.name.capitalize(), target.mean_radius_km * 1e3
    return CRS.from_wkt(
        f'GEOGCRS["{name} - Sphere / Ocentric",DATUM["{name} - Sphere",ELLIPSOID["{name} - Sphere",{radius_m},0]],'
        'PRIMEM["Reference Meridian",0],CS[ellipsoidal,2],AXIS["geodetic latitude (Lat)",north],'
        'AXIS["geodetic longitude (Lon)",east],ANGLEUNIT["degree",0.0174532925199433]]'
    )


def map_projection(
    name: str,
    target: Target,
    resolution_km: float,
    centre_deg: tuple[float, float],
    central_longitude_deg: float | None = None,
) -> MapProjection:
    """One of PROJECTIONS. centre_deg: latitude and east longitude of what is to be shown; the orthographic map is
    centred on it, the polar one on the pole of its side. central_longitude_deg: of the equirectangular map (default:
    0 or 180, the nearer one), or what points down (north) or up (south) in the polar one (default 0). The pixels of
    equirectangular maps are made to fit a whole number of times into 180 degrees.

    Raises RefusedError for another name, or a resolution that is no length.
    """
    from pyproj.crs import ProjectedCRS

    if not math.isfinite(resolution_km) or resolution_km <= 0:
        raise RefusedError(
            Reason.RESOLUTION_INVALID, f"a resolution of {resolution_km} km.", "Give kilometres per pixel."
        )
    geographic = body_crs(target)
    radius_m = float(geographic.ellipsoid.semi_major_metre) if geographic.ellipsoid else 0.0
    step_m = resolution_km * 1e3
    latitude, longitude = centre_deg
    title = f"{target.name.capitalize()} / Ocentric / {name.replace('-', ' ').title()}"
    if name == "equirectangular":
        middle = central_longitude_deg if central_longitude_deg is not None else 180.0 * (90 <= longitude % 360 < 270)
        step_m = math.pi * radius_m / max(round(math.pi * radius_m / step_m), 1)
        half = math.pi * radius_m
        extent, conversion = (-half, -half / 2, half, half / 2), _equirectangular(middle)
    elif name == "orthographic":
        extent, conversion = (-radius_m, -radius_m, radius_m, radius_m), _orthographic(latitude, longitude)
    elif name == "polar-stereographic":
        reach = 2 * radius_m  # the equator
        extent, conversion = (-reach, -reach, reach, reach), _polar(latitude, central_longitude_deg or 0.0)
    else:
        raise RefusedError(
            Reason.PROJECTION_UNKNOWN, f"no projection {name!r}.", f"Known are {', '.join(PROJECTIONS)}."
        )
    return MapProjection(name, ProjectedCRS(conversion, geodetic_crs=geographic, name=title), extent, step_m)


def grid_of(projection: MapProjection, bounds_m: Bounds) -> MapGrid:
    """The grid of whole pixels that covers `bounds_m`, inside the projection's extent; pixel edges lie at multiples of
    the step from x = y = 0 (equirectangular: from the left edge and the pole). Raises RefusedError when too large."""
    left, _, _, top = projection.extent_m
    step = projection.step_m
    origin_x, origin_y = (left, top) if projection.name == "equirectangular" else (0.0, 0.0)
    columns = math.floor((bounds_m[0] - origin_x) / step + 1e-6), math.ceil((bounds_m[2] - origin_x) / step - 1e-6)
    rows = math.floor((origin_y - bounds_m[3]) / step + 1e-6), math.ceil((origin_y - bounds_m[1]) / step - 1e-6)
    shape = rows[1] - rows[0], columns[1] - columns[0]
    if max(shape) > LARGEST_SIDE_PX:
        raise RefusedError(
            Reason.MAP_TOO_LARGE,
            f"a map of {shape[1]}x{shape[0]} pixels at {step / 1e3:.4g} km.",
            "Give a coarser --resolution-km.",
        )
    return MapGrid(projection, origin_x + columns[0] * step, origin_y - rows[0] * step, shape)


def _equirectangular(central_longitude_deg: float):  # type: ignore[no-untyped-def]
    from pyproj.crs.coordinate_operation import EquidistantCylindricalConversion

    return EquidistantCylindricalConversion(
        latitude_first_parallel=0.0, longitude_natural_origin=signed_deg(central_longitude_deg)
    )


def _orthographic(latitude_deg: float, longitude_deg: float):  # type: ignore[no-untyped-def]
    from pyproj.crs.coordinate_operation import OrthographicConversion

    return OrthographicConversion(
        latitude_natural_origin=latitude_deg, longitude_natural_origin=signed_deg(longitude_deg)
    )


def _polar(latitude_deg: float, longitude_deg: float):  # type: ignore[no-untyped-def]
    from pyproj.crs.coordinate_operation import PolarStereographicAConversion

    pole = 90.0 if latitude_deg >= 0 else -90.0
    return PolarStereographicAConversion(
        latitude_natural_origin=pole,
        longitude_natural_origin=signed_deg(longitude_deg),
        scale_factor_natural_origin=1.0,
    )


def signed_deg(longitude_deg: float) -> float:
    """The same longitude in (-180, 180]."""
    return 180.0 - (180.0 - longitude_deg) % 360.0
