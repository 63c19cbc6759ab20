"""planes.zarr beside a product's cube: planes that the cube does not hold, of the same pixels and the same pose."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import camera_from_dict
from catalog.digest import sha256_of_file
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.target import Target
from catalog.times import now_utc
from tasks.atomic import file_put_in_place, folder_put_in_place
from tasks.project.more_planes import MORE_PLANES, more_planes
from tasks.publish.checksums import CHECKSUMS, read_checksums
from tasks.publish.contained import reading_product
from tasks.publish.cube import CONVENTIONS, compressor, open_cube, software_version, write_group
from tasks.publish.names import CUBE
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


def write_extra_planes(folder: Path, planes: Sequence[str] = tuple(MORE_PLANES)) -> Path:
    """Write `planes` (of MORE_PLANES) of the product in `folder` into its planes.zarr, which is exchanged as a whole,
    and its checksums; return the path. Raises RefusedError when the folder holds no cube."""
    folder = Path(folder)
    if not (folder / CUBE).is_dir():
        raise RefusedError("product-missing", f"{folder} holds no {CUBE}.", "Give a product's folder, or a store.")
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
    values = more_planes(Pose.from_dict(json.loads(cube.attrs["pose_after"])), camera, target, places_of(cube), planes)
    variables = {name: (("y", "x"), as_float32(name, values[name]), _attributes(name)) for name in planes}
    source = f"planetpose {software_version()}"
    copied = {key: cube.attrs[key] for key in COPIED if key in cube.attrs}
    attributes = {"Conventions": CONVENTIONS, "source": source, "history": f"{now_utc()} written by {source}", **copied}
    return xr.Dataset(variables, {name: cube[name] for name in ("x", "y")}, attributes)


def places_of(cube: "xr.Dataset") -> NDArray[np.float64]:
    """Places (ny, nx, 2) of a cube's pixels in the undistorted frame."""
    if cube.attrs.get("pixel_space") == SENSOR:
        return np.stack([cube["place_x"].values, cube["place_y"].values], axis=-1).astype(np.float64)
    return np.stack(np.meshgrid(cube["x"].values, cube["y"].values), axis=-1).astype(np.float64)


def as_float32(name: str, values: NDArray[np.float64]) -> NDArray[np.float32]:
    """float32; what rounds up to a full turn or day becomes 0."""
    stored = values.astype(np.float32)
    top = (MORE_PLANES[name].valid_range or (0.0, np.inf))[1]
    if top in (24.0, 360.0):
        stored[stored >= top] = 0
    return stored


def _attributes(name: str) -> dict[str, Any]:
    plane = MORE_PLANES[name]
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
