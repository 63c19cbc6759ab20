"""Is a product what it was when it was published, and is that what a product should be?

A digest finds damage, the table of variables finds what should never have been written, and a new projection of the
pose finds planes that belong to another one.
"""

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.plain_files import own_json
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import Target
from tasks.project.backplanes import PLANES
from tasks.project.pixels import project_pixels
from tasks.publish.checksums import checksum_faults
from tasks.publish.contained import DAMAGE, faults_of_place
from tasks.publish.cube import open_cube
from tasks.publish.cube_model import models_in
from tasks.publish.index import product_folders
from tasks.publish.names import CUBE, RESULT, SETTINGS
from tasks.publish.step import STEP
from tasks.publish.variables import cube_faults
from tasks.record import RECORD_FILE, record_in
from tasks.step import key_of

if TYPE_CHECKING:
    import xarray as xr

NESTED = ("pose_before", "pose_after", "uncertainty", "camera_model", "target_model", "settings", "provenance")
PROVENANCE = ("image", "kernels")
WORDING = re.compile(r": attribute (comment|long_name|ancillary_variables|valid_range) is ")  # versions differ in it
SAMPLES = 400
AT_LIMB_DEG = 80.0  # emission beyond which a small step of the pixel is a large one on the surface


@dataclass(frozen=True)
class Fault:
    """What is wrong, and where: `file`, `schema`, `values`, `provenance` or `geometry`."""

    kind: str
    text: str

    def __str__(self) -> str:
        return f"{self.kind}: {self.text}"


def products_in(path: Path) -> list[Path]:
    """The product folders that a path means: itself, or those in a store. Raises RefusedError when there are none."""
    path = Path(path)
    if is_one_product(path):
        return [path]
    names = sorted(product_folders(path)) if path.is_dir() else []
    products = [path / name for name in names if has_product_files(path / name)]
    if not products:
        raise RefusedError(Reason.PRODUCT_MISSING, f"{path} holds no product.", "Give a store or a product's folder.")
    return products


def is_one_product(path: Path) -> bool:
    """Whether a folder is a product, and not a store of them."""
    return (path / CUBE).is_dir() or (path / RESULT).is_file()


def has_product_files(folder: Path) -> bool:
    """Whether a folder of a store holds a product, or what is left of one."""
    return any(os.path.exists(os.path.join(folder, name)) for name in (CUBE, RESULT, RECORD_FILE))


def product_faults(folder: Path) -> list[Fault]:
    """Everything that is wrong with the product in `folder`; empty when it is sound."""
    elsewhere = [Fault("file", text) for text in faults_of_place(folder)]
    if elsewhere:  # nothing of it is read
        return elsewhere
    faults = [Fault("file", text) for text in checksum_faults(folder)]
    if not (folder / CUBE).is_dir():  # one fault, not one for every file that was in it
        others = [fault for fault in faults if not fault.text.startswith(f"{CUBE}/")]
        return [Fault("file", f"{CUBE} is missing"), *others]
    faults += [Fault("file", text) for text in _paper_faults(folder)]
    try:
        with open_cube(folder / CUBE) as lazy:
            cube = lazy.load()
    except (*DAMAGE, RefusedError) as error:
        return [*faults, Fault("file", f"{CUBE} cannot be read: {type(error).__name__}: {error}")]
    departures = [text for text in cube_faults(cube) if not WORDING.search(text)]
    faults += [Fault("values" if "values" in text else "schema", text) for text in departures]
    faults += [Fault("values", text) for text in _image_faults(cube)]
    provenance = list(_provenance_faults(cube.attrs, folder.name))
    faults += [Fault("provenance", text) for text in provenance]
    if not faults:
        faults += [Fault("geometry", text) for text in _geometry_faults(cube)]
    return faults


def _paper_faults(folder: Path) -> Iterator[str]:
    """result.json, settings.json and record.json: readable, and of one mind."""
    contents = {}
    for name in (RESULT, SETTINGS):
        try:
            contents[name] = own_json((folder / name).read_text(encoding="utf-8"))
        except FileNotFoundError:
            continue  # its checksum has said so
        except (OSError, ValueError) as error:
            yield f"{name} cannot be read: {error}"
    if not (folder / RECORD_FILE).is_file():
        return  # published from Python, not by the flow
    try:
        record = record_in(folder)
    except (OSError, ValueError, TypeError) as error:
        yield f"{RECORD_FILE} cannot be read: {error}"
        return
    if record.key != key_of(STEP, record.code, record.inputs):
        yield f"{RECORD_FILE}: its key is not that of its inputs"
    corrected, result = record.result.get("correction", {}), contents.get(RESULT, {})
    differing = [key for key, value in corrected.items() if result and result.get(key) != value]
    if differing:
        yield f"{RECORD_FILE} and {RESULT} disagree on {', '.join(differing)}"


def _image_faults(cube: "xr.Dataset") -> Iterator[str]:
    """Infinite values, and an image without any."""
    for name in cube.variables:
        values = cube[name].values
        if values.dtype.kind == "f" and np.isinf(values).any():
            yield f"{name}: {int(np.isinf(values).sum())} infinite values"
    if "image" in cube and not np.isfinite(cube["image"].values).any():
        yield "image: no finite values"


def _provenance_faults(attributes: Mapping[str, Any], product: str) -> Iterator[str]:
    if attributes.get("product") not in (None, product):
        yield f"the cube is of {attributes['product']}, the folder of {product}"
    parsed: dict[str, Any] = {}
    for name in NESTED:
        try:
            parsed[name] = own_json(attributes[name])
        except KeyError:
            continue  # the table of variables has said so of those that must be there
        except (ValueError, TypeError) as error:
            yield f"attribute {name} is no JSON: {error}"
    for name in ("pose_before", "pose_after"):
        try:
            Pose.from_dict(parsed.get(name, {}))
        except (ValueError, TypeError) as error:
            yield f"attribute {name} is no pose: {error}"
    provenance = parsed.get("provenance")
    missing = [key for key in PROVENANCE if not isinstance(provenance, dict) or key not in provenance]
    if missing:
        yield f"attribute provenance lacks {', '.join(missing)}"


def _geometry_faults(cube: "xr.Dataset") -> Iterator[str]:
    """Planes that are not what the cube's own pose gives at some hundred pixels on the body."""
    seen = ((cube["quality"].values & Quality.OFF_BODY) == 0) & (cube["emission"].values < AT_LIMB_DEG)
    if "body_id" in cube:
        seen &= cube["body_id"].values == models_in(cube.attrs)[1].naif_id
    ys, xs = np.nonzero(seen)
    if not len(ys):
        return
    chosen = np.random.default_rng(0).integers(0, len(ys), SAMPLES)
    ys, xs = ys[chosen], xs[chosen]
    on_detector = "place_x" in cube
    places = [cube[name].values[ys, xs] for name in ("place_x", "place_y")] if on_detector else [xs, ys]
    camera, target, pose = models_in(cube.attrs)
    try:
        expected = project_pixels(pose, camera, target, np.stack(places, axis=-1).astype(float))
    except RefusedError as error:  # a shape model that is no longer where it was
        yield f"cannot be checked: {error.fault}"
        return
    on_edges = 0 if target.shape is None else SAMPLES // 50  # of triangles, where another window may see the neighbour
    for name in PLANES:
        if on_detector and name == "resolution_km":
            continue  # it is that of a raw pixel
        off = _difference(name, cube[name].values[ys, xs].astype(np.float64), expected[name])
        wrong = ~(off <= _tolerance(name, expected, target))
        if wrong.sum() > on_edges:
            yield f"{name} differs from the pose's by up to {np.nanmax(off):.3g} at {wrong.sum()} of {SAMPLES} pixels"


def _tolerance(name: str, expected: Mapping[str, NDArray[np.float64]], target: Target) -> NDArray[np.float64]:
    """More than float32 does to a plane and to the places of raw pixels, and than versions differ in how they treat
    aberration (0.04 deg): 0.05 deg and a twentieth of a footprint. Planes of another pose are farther off."""
    if name in ("range_km", "resolution_km"):
        return 1e-3 * expected[name]
    footprint_deg = np.degrees(expected["resolution_km"] / min(target.radii_km))
    along = np.maximum(np.cos(np.radians(expected["latitude"])), 1e-3) if name == "longitude" else 1.0
    return (0.05 + 0.05 * footprint_deg) / along


def _difference(name: str, a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    off = np.abs(a - b)
    return np.minimum(off, np.abs(360.0 - off)) if name == "longitude" else off
