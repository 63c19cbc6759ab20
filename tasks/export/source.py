"""What an export is made from: a product's cube, and the pose, camera and target that it carries."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera, camera_from_dict
from catalog.errors import RefusedError
from catalog.observation import UNUSABLE
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import Target
from tasks.publish.contained import reading_product
from tasks.publish.cube import open_cube
from tasks.publish.extra_planes import EXTRA
from tasks.publish.names import CUBE
from tasks.publish.publication import SENSOR

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Source:
    """One product, read. cube: loaded. pose: the corrected one."""

    product: str
    folder: Path
    cube: "xr.Dataset"
    pose: Pose
    camera: Camera
    target: Target

    @property
    def attributes(self) -> dict[str, Any]:
        """The cube's attributes."""
        return dict(self.cube.attrs)

    @property
    def on_detector(self) -> bool:
        """Whether the cube's pixels are the detector's own, not those of the undistorted frame."""
        return bool(self.cube.attrs.get("pixel_space") == SENSOR)

    def undistorted_image(self) -> NDArray[np.float32]:
        """Image (ny, nx) of the undistorted frame, NaN where its pixels are unusable."""
        if self.on_detector:
            usable = _usable_in_undistorted_frame(self.cube, self.camera.size_px[::-1])
            image = self.cube["resampled_image"].values
        else:
            usable = (self.cube["quality"].values & UNUSABLE) == 0
            image = self.cube["image"].values
        return np.where(usable, image, np.float32(np.nan)).astype(np.float32)

    def extra_planes(self) -> dict[str, "xr.DataArray"]:
        """Planes that were added beside the cube, by name; read."""
        if not (self.folder / EXTRA).is_dir():
            return {}
        with open_cube(self.folder / EXTRA) as extra:
            return {str(name): array.load() for name, array in extra.data_vars.items()}


def read_source(folder: Path) -> Source:
    """The product in `folder`. Raises RefusedError when it holds no cube, or none that can be read."""
    folder = Path(folder)
    if not (folder / CUBE).is_dir():
        raise RefusedError(Reason.PRODUCT_MISSING, f"{folder} holds no {CUBE}.", "Give a product's folder, or a store.")
    with reading_product(folder):
        with open_cube(folder / CUBE) as lazy:
            cube = lazy.load()
        pose = Pose.from_dict(json.loads(cube.attrs["pose_after"]))
        camera = camera_from_dict(json.loads(cube.attrs["camera_model"]), f"of the cube in {folder}")
        target = Target.model_validate(json.loads(cube.attrs["target_model"]))
    return Source(folder.name, folder, cube, pose, camera, target)


def _usable_in_undistorted_frame(cube: "xr.Dataset", shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Pixels of the undistorted frame with a usable raw pixel within one pixel, and no unusable one."""
    import cv2

    unusable = (cube["quality"].values & UNUSABLE) != 0
    near = []
    for chosen in (~unusable, unusable):
        x, y = (cube[name].values[chosen] for name in ("place_x", "place_y"))
        known = np.isfinite(x) & np.isfinite(y)
        column, row = np.rint(x[known]).astype(int), np.rint(y[known]).astype(int)
        inside = (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0])
        hit = np.zeros(shape, np.uint8)
        hit[row[inside], column[inside]] = 1
        near.append(cv2.dilate(hit, np.ones((3, 3), np.uint8)) > 0)
    return near[0] & ~near[1]
