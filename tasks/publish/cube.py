"""The geometry cube: an xarray Dataset with CF attributes, and its Zarr v3 group."""

import json
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.target import Target
from catalog.times import now_utc, utc_from_et
from tasks.publish.contained import DAMAGE, damage_refused, reading_cube
from tasks.publish.names import CUBE
from tasks.publish.plain_cube import PlainCube, Plane
from tasks.publish.planes import cube_arrays
from tasks.publish.publication import NOT_RESAMPLED, SENSOR, Publication
from tasks.publish.variables import BY_NAME, COORDINATES, DIMENSIONS, FLAGS, GRID_MAPPING, cube_faults, variables_of

if TYPE_CHECKING:
    import xarray as xr

# 1-sigma of the result that a cube repeats.
STATED = ("offset_px", "range_factor", "roll_deg", "attitude_deg")
CONVENTIONS = "CF-1.11"


def cube_dataset(publication: Publication) -> "xr.Dataset":
    """The cube of one image as xarray has it; raises as `plain_cube`."""
    return plain_cube(publication).dataset()


def plain_cube(publication: Publication) -> PlainCube:
    """The cube of one image. Raises ValueError, listing every fault, when it departs from `variables.VARIABLES`."""
    arrays = cube_arrays(publication)
    variables = variables_of(publication.pixel_space, "body_id" in arrays)
    planes = {v.name: Plane(v.dims, arrays[v.name], _attributes(v.name, publication)) for v in variables}
    ny, nx = publication.pixels.image.shape
    frame = "raw" if publication.sensor else "undistorted"
    pixels = {
        "x": Plane(
            ("x",), np.arange(nx, dtype=np.int32), _pixel_attributes(f"sample of the {frame} frame", "to the right")
        ),
        "y": Plane(("y",), np.arange(ny, dtype=np.int32), _pixel_attributes(f"line of the {frame} frame", "downwards")),
    }
    crs = {GRID_MAPPING: Plane((), np.asarray(0, np.int32), crs_attributes(publication.target))}
    attributes = global_attributes(publication)
    cube = PlainCube(planes | crs | pixels, tuple(COORDINATES), frozenset(planes), attributes)
    faults = cube_faults(cube)
    if faults:
        raise ValueError(f"the cube of {publication.product} is not as it should be: {'; '.join(faults)}")
    return cube


def write_group(dataset: "xr.Dataset", path: Path, encoding: dict[str, dict[str, Any]]) -> None:
    """Write a new Zarr v3 group with consolidated metadata, which zarr 3 reads and writes ahead of the standard."""
    import warnings

    warnings.filterwarnings("ignore", "Consolidated metadata is currently not part in the Zarr format 3")
    dataset.to_zarr(path, mode="w-", zarr_format=3, consolidated=True, encoding=encoding)


def open_cube(path: "Path | str", chunked: bool = True) -> "xr.Dataset":
    """Open a cube lazily; a path, or a URL that fsspec understands. chunked: as dask arrays; otherwise each plane is
    read as a whole whenever its values are wanted, which costs a third of the time for a single cube, and nothing of it
    stays in memory. Raises RefusedError when something in it is a link that leads out of its store, or no file, or when
    it is damaged."""
    import xarray as xr

    def opened() -> "xr.Dataset":
        if chunked:
            return xr.open_zarr(path, consolidated=None)
        return xr.open_dataset(path, engine="zarr", chunks=None, cache=False, consolidated=None)

    if "://" in str(path):
        return opened()
    with reading_cube(Path(path)):
        return opened()


def plane_values(cube: "xr.Dataset", name: str) -> NDArray[Any]:
    """Values of a plane of a cube that `open_cube` opened, or of a part of it. Raises RefusedError where its chunks are
    damaged, which shows only when they are read."""
    try:
        return np.asarray(cube[name].values)
    except DAMAGE as error:
        opened = Path(str(cube.encoding.get("source", cube.attrs.get("product", "memory"))))
        raise damage_refused(opened.parent if opened.name == CUBE else opened, error) from error


def _pixel_attributes(name: str, direction: str) -> dict[str, str]:
    return {
        "long_name": name,
        "units": "1",
        "comment": f"0-based, integer at the pixel's centre, growing {direction}",
    }


def _attributes(name: str, publication: Publication) -> dict[str, Any]:
    attributes: dict[str, Any] = dict(BY_NAME[name].attributes)
    if BY_NAME[name].dims == DIMENSIONS:
        attributes["grid_mapping"] = GRID_MAPPING
    if name == "quality":
        attributes["flag_masks"] = [int(flag) for flag in FLAGS]
        attributes["flag_meanings"] = " ".join(str(flag.name).lower() for flag in FLAGS)
    if name in ("latitude_uncertainty", "longitude_uncertainty") and publication.uncertainty_not_included:
        attributes["not_included"] = " ".join(publication.uncertainty_not_included)
    return attributes


def crs_attributes(target: Target) -> dict[str, Any]:
    """CF grid mapping of planetocentric coordinates: the IAU_2015 code where the body has one, and the triaxial radii
    that the planes were projected on, which IAU codes and CF cannot express."""
    from pyproj import CRS

    if target.iau_crs:
        attributes = {**CRS.from_user_input(target.iau_crs).to_cf(), "iau_code": target.iau_crs}
    else:
        mean_m = target.mean_radius_km * 1e3
        attributes = {
            "grid_mapping_name": "latitude_longitude",
            "semi_major_axis": mean_m,
            "inverse_flattening": 0.0,
            "longitude_of_prime_meridian": 0.0,
        }
    return {
        **attributes,
        "long_name": f"body-fixed planetocentric coordinates of {target.name}",
        "triaxial_radii_km": list(target.radii_km),
        "naif_id": target.naif_id,
        "naif_frame": target.body_frame,
        "comment": "latitude and longitude of points on the triaxial ellipsoid, seen from the body's centre",
    }


def global_attributes(publication: Publication) -> dict[str, Any]:
    """Who, when, what, and the full provenance; nested values as JSON text, for netCDF's sake."""
    p = publication
    source = f"planetpose {software_version()}"
    nested = {
        "pose_before": p.pose_before.to_dict(),
        "pose_after": p.pose_after.to_dict(),
        "uncertainty": {
            **{key: p.result.get("uncertainty", {}).get(key) for key in STATED},
            **p.uncertainty.to_dict(),
        },
        "camera_model": p.camera.model_dump(mode="json", exclude_defaults=True),
        "target_model": p.target.model_dump(mode="json", exclude_defaults=True),
        "settings": p.settings,
        "provenance": p.provenance,
    }
    return {
        "Conventions": CONVENTIONS,
        "title": f"Geometry of {p.product}: {p.target.name} seen by {p.camera.name}",
        "source": source,
        "history": f"{now_utc()} written by {source}",
        "references": "Belgacem et al. 2020, Planetary and Space Science",
        "product": p.product,
        "camera": p.camera.name,
        "target": p.target.name,
        "utc": utc_from_et(p.pose_after.et),
        "et": float(p.pose_after.et),
        "pixel_space": p.pixel_space,
        "resampling_kernel": NOT_RESAMPLED if p.pixel_space == SENSOR else p.kernel,
        **{key: json.dumps(value, allow_nan=False) for key, value in nested.items()},
    }


@cache
def software_version() -> str:
    """Version of the installed package."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("planetpose")
    except PackageNotFoundError:
        return "unknown"
