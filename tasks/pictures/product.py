"""A finished product, read back: what the pictures of its limb need."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalog.basemap import BaseMap, packaged_map_path, read_map, uniform_map
from catalog.camera import Camera, camera_from_dict
from catalog.errors import RefusedError
from catalog.observation import Observation, Quality
from catalog.plain_files import own_json
from catalog.pose import Pose
from catalog.readers.noise import measured_noise
from catalog.reasons import Reason
from catalog.target import Target
from tasks.publish.contained import reading_product
from tasks.publish.cube import open_cube
from tasks.publish.product import CUBE, no_cube_in
from tasks.simulate import Scene, SceneSettings
from tasks.validate import ValidateSettings

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Product:
    """name; observation: the undistorted frame, its noise measured anew; before, after: predicted and corrected pose;
    scene: with the base map and settings that the product was made with; limb: the settings of its validation."""

    name: str
    observation: Observation
    before: Pose
    after: Pose
    scene: Scene
    limb: ValidateSettings


def read_product(folder: Path, basemap: Path | None = None) -> Product:
    """Read a product folder. basemap: the user's own map that the product was made with, if it was.

    Raises RefusedError when the folder holds no cube, or the base map is not at hand.
    """
    folder = Path(folder)
    with reading_product(folder):
        if not (folder / CUBE).is_dir():
            raise no_cube_in(folder)
        return product_in(folder, CUBE, basemap)


def product_in(folder: Path, cube_name: str, basemap: Path | None = None) -> Product:
    """The same of a group with the attributes of a cube under another name. Raises RefusedError where the base map is
    not at hand."""
    with open_cube(folder / cube_name) as cube:
        attributes = {name: _loaded(value) for name, value in cube.attrs.items()}
        resampled = "resampled_image" in cube
        image = cube["resampled_image" if resampled else "image"].values
        quality = np.zeros(image.shape, np.uint16) if resampled else cube["quality"].values.astype(np.uint16)
    target = Target.model_validate(attributes["target_model"])
    camera: Camera = camera_from_dict(attributes["camera_model"], f"of the cube in {folder}")
    settings = attributes["settings"]
    known = map_of_product(attributes["provenance"].get("basemap", {}), target, basemap, folder)
    return Product(
        attributes["product"],
        _observation(image, quality),
        Pose.from_dict(attributes["pose_before"]),
        Pose.from_dict(attributes["pose_after"]),
        Scene(camera, target, known, SceneSettings.model_validate(settings.get("simulate", {}))),
        ValidateSettings.model_validate(settings.get("validate", {})),
    )


def opened_cube(folder: Path) -> "xr.Dataset":
    """The cube of a product folder, lazy; to be closed. Raises RefusedError when the folder holds none."""
    if not (Path(folder) / CUBE).is_dir():
        raise no_cube_in(Path(folder))
    return open_cube(Path(folder) / CUBE)


def _loaded(value: Any) -> Any:
    return own_json(value) if isinstance(value, str) and value[:1] in "{[" else value


def _observation(image: np.ndarray, quality: np.ndarray) -> Observation:
    """The pixels, those without a value flagged."""
    finite = np.isfinite(image)
    quality = np.where(finite, quality, quality | np.uint16(Quality.MISSING)).astype(np.uint16)
    image = np.where(finite, image, 0).astype(np.float32)
    bare = Observation(image, np.ones_like(image), quality)
    return Observation(image, measured_noise(image, bare.usable, False), quality)


def map_of_product(made_with: dict[str, Any], target: Target, given: Path | None, folder: Path) -> BaseMap:
    """The base map whose hash is in the product: the user's, or the catalog's."""
    if made_with.get("sha256") == "uniform":
        return uniform_map()
    path = given or (packaged_map_path(target.basemap) if target.basemap else None)
    found = read_map(path, made_with.get("left_edge_deg", 0.0)) if path else None
    if found is None or found.sha256 != made_with.get("sha256"):
        raise RefusedError(
            Reason.MAP_DIFFERS,
            f"{folder} was made with the base map {made_with.get('name')}, which {path or 'the catalog'} is not.",
            "Give the same file again with --map.",
        )
    return found
