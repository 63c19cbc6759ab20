"""planes.zarr beside a product's cube: planes that the cube does not hold, of the same pixels and the same pose."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera, camera_from_dict
from catalog.digest import sha256_of_file
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import Target
from catalog.times import now_utc
from tasks.atomic import file_put_in_place, folder_put_in_place
from tasks.project.more_planes import ADDED_PLANES, MORE_PLANES, SIGMA_PARTS, more_planes
from tasks.project.uncertainty import NEEDED, PoseUncertainty, coordinate_sigmas
from tasks.publish.checksums import CHECKSUMS, read_checksums
from tasks.publish.contained import reading_product
from tasks.publish.cube import CONVENTIONS, open_cube, software_version, write_group
from tasks.publish.names import CUBE
from tasks.publish.plain_cube import compressor
from tasks.publish.publication import SENSOR

if TYPE_CHECKING:
    import xarray as xr

EXTRA = "planes.zarr"
COPIED = (
    "title",
    "product",
    "camera",
    "target",
    "utc",
    "et",
    "pixel_space",
    "pose_after",
    "camera_model",
    "target_model",
)


def write_extra_planes(folder: Path, planes: Sequence[str] = tuple(ADDED_PLANES)) -> Path:
    """Write `planes` (of ADDED_PLANES) of the product in `folder` into its planes.zarr, which is exchanged as a whole,
    and its checksums; return the path. Raises RefusedError when the folder holds no cube."""
    folder = Path(folder)
    if not (folder / CUBE).is_dir():
        raise RefusedError(Reason.PRODUCT_MISSING, f"{folder} holds no {CUBE}.", "Give a product's folder, or a store.")
    with reading_product(folder), open_cube(folder / CUBE) as cube:
        dataset = extra_dataset(cube, planes)
    encoding: dict[str, dict[str, Any]] = {
        name: {"chunks": dataset[name].shape, "compressors": [compressor()]} for name in planes
    }
    with folder_put_in_place(folder / EXTRA) as temporary:
        temporary.rmdir()  # the group is written as a new folder
        write_group(dataset, temporary, encoding)
    _refresh_checksums(folder)
    return folder / EXTRA


def extra_dataset(cube: "xr.Dataset", planes: Sequence[str]) -> "xr.Dataset":
    """`planes` of an open cube's pixels, float32, with CF attributes and the cube's pose."""
    import xarray as xr

    camera = camera_from_dict(json.loads(cube.attrs["camera_model"]), "of the cube")
    target = Target.model_validate(json.loads(cube.attrs["target_model"]))
    pose, places = Pose.from_dict(json.loads(cube.attrs["pose_after"])), places_of(cube)
    values = more_planes(pose, camera, target, places, [name for name in planes if name in MORE_PLANES])
    values |= sigma_parts(cube, pose, camera, target, places, [name for name in planes if name in SIGMA_PARTS])
    variables = {name: (("y", "x"), as_float32(name, values[name]), _attributes(name)) for name in planes}
    source = f"planetpose {software_version()}"
    copied = {key: cube.attrs[key] for key in COPIED if key in cube.attrs}
    attributes = {"Conventions": CONVENTIONS, "source": source, "history": f"{now_utc()} written by {source}", **copied}
    return xr.Dataset(variables, {name: cube[name] for name in ("x", "y")}, attributes)


def sigma_parts(
    cube: "xr.Dataset", pose: Pose, camera: Camera, target: Target, xy_px: NDArray[np.float64], names: Sequence[str]
) -> dict[str, NDArray[np.float64]]:
    """Parts (of SIGMA_PARTS) of the uncertainty of latitude and longitude in the pixels `xy_px` (ny, nx, 2): NaN off
    the body, and everywhere where nobody knows the part."""
    from tasks.project.pixels import seen_at

    if not names:
        return {}
    whole = PoseUncertainty.from_dict(json.loads(cube.attrs["uncertainty"]))
    on_body, seen = seen_at(pose, camera, target, xy_px)
    place_px = cube["distortion_uncertainty"].values.astype(np.float64)
    exact = PoseUncertainty(np.zeros_like(whole.covariance))
    of_part = {
        "pose": (whole.without_map_frame, 0.0) if len(whole.not_included) < len(NEEDED) else None,
        "distortion": (exact, place_px[on_body]) if np.isfinite(place_px[on_body]).all() else None,
        "map_frame": (whole.of_map_frame, 0.0) if "attitude_deg" not in whole.not_included else None,
    }
    found = {name: np.full(on_body.shape, np.nan) for name in names}
    for part, errors in of_part.items():
        wanted = [name for name in names if SIGMA_PARTS[name].part == part]
        if errors is None or not wanted:
            continue
        sigmas = coordinate_sigmas(pose, camera, target, errors[0], seen.points_km.T, errors[1])
        both = dict(zip(("latitude", "longitude"), sigmas, strict=True))
        for name in wanted:
            found[name][on_body] = both[SIGMA_PARTS[name].coordinate]
    return found


def places_of(cube: "xr.Dataset") -> NDArray[np.float64]:
    """Places (ny, nx, 2) of a cube's pixels in the undistorted frame."""
    if cube.attrs.get("pixel_space") == SENSOR:
        return np.stack([cube["place_x"].values, cube["place_y"].values], axis=-1).astype(np.float64)
    return np.stack(np.meshgrid(cube["x"].values, cube["y"].values), axis=-1).astype(np.float64)


def as_float32(name: str, values: NDArray[np.float64]) -> NDArray[np.float32]:
    """float32; what rounds up to a full turn or day becomes 0."""
    stored = values.astype(np.float32)
    top = (ADDED_PLANES[name].valid_range or (0.0, np.inf))[1]
    if top in (24.0, 360.0):
        stored[stored >= top] = 0
    return stored


def _attributes(name: str) -> dict[str, Any]:
    plane = ADDED_PLANES[name]
    limits = {"valid_range": [float(np.float32(v)) for v in plane.valid_range]} if plane.valid_range else {}
    return {"long_name": plane.long_name, "units": plane.units, **limits}


def _refresh_checksums(folder: Path) -> None:
    """Make the product's list of checksums tell the present planes.zarr; its other lines stay as published."""
    if not (folder / CHECKSUMS).is_file():
        return
    others = {name: digest for name, digest in read_checksums(folder).items() if not name.startswith(f"{EXTRA}/")}
    files = sorted(path for path in (folder / EXTRA).rglob("*") if path.is_file())
    digests = others | {path.relative_to(folder).as_posix(): sha256_of_file(path) for path in files}
    text = "".join(f"{digest}  {name}\n" for name, digest in sorted(digests.items()))
    with file_put_in_place(folder / CHECKSUMS) as temporary:
        temporary.write_text(text, encoding="utf-8")
