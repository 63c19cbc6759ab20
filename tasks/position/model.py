"""A product's geometry with its uncertainty, and the pixels themselves, as positions are answered from them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.plain_files import own_json
from catalog.reasons import Reason
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish.contained import reading_product
from tasks.publish.cube import open_cube, plane_values
from tasks.publish.cube_model import CubeModel, model_of
from tasks.publish.names import CUBE
from tasks.publish.product import no_cube_in

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PositionModel:
    """geometry: pose, camera, target. uncertainty: None where the cube states none. cube: for values, flags and what
    the distortion adds; None where there are no pixels."""

    product: str
    geometry: CubeModel
    uncertainty: PoseUncertainty | None = None
    cube: "xr.Dataset | None" = None
    _read: dict[str, NDArray[Any]] = field(default_factory=dict, repr=False, compare=False)

    def place_sigma_px(self, xy_px: Array) -> Array:
        """1-sigma (n,) of each coordinate of the undistorted places of the image's pixels (n, 2): of the nearest pixel
        within the frame; 0 where the cube knows none."""
        index = self._nearest(np.asarray(xy_px), clipped=True)
        known = self._plane("distortion_uncertainty")
        found = np.zeros(len(xy_px)) if known is None else known[index].astype(np.float64)
        return np.nan_to_num(found)

    def pixel(self, xy_px: Array) -> tuple[float | None, tuple[str, ...] | None]:
        """Value and names of the flags of the pixel nearest to (2,); None outside of the frame."""
        rows, columns = self._nearest(np.asarray(xy_px)[None])
        image, quality = self._plane("image"), self._plane("quality")
        if image is None or quality is None or self.cube is None or rows[0] < 0:
            return None, None
        value, bits = float(image[rows[0], columns[0]]), int(quality[rows[0], columns[0]])
        attributes = self.cube["quality"].attrs
        names = zip(attributes["flag_masks"], str(attributes["flag_meanings"]).split(), strict=True)
        return value if np.isfinite(value) else None, tuple(name for mask, name in names if bits & int(mask))

    def _nearest(self, xy_px: Array, clipped: bool = False) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns (n,) in the cube; -1 outside of it."""
        if self.cube is None:
            nowhere = np.full(len(xy_px), -1)
            return nowhere, nowhere
        first = np.array([float(self.cube[name][0]) for name in ("x", "y")])
        size = np.array([self.cube.sizes[name] for name in ("x", "y")])
        finite = np.asarray(np.isfinite(xy_px).all(axis=1))
        index = np.rint(np.where(finite[:, None], xy_px, 0.0) - first).astype(np.int64)
        inside = np.asarray(finite & ((index >= 0) & (index < size)).all(axis=1))
        index = np.clip(index, 0, size - 1) if clipped else np.where(inside[:, None], index, -1)
        return index[:, 1], index[:, 0]

    def _plane(self, name: str) -> NDArray[Any] | None:
        if self.cube is None or name not in self.cube:
            return None
        if name not in self._read:
            self._read[name] = plane_values(self.cube, name)
        return self._read[name]


def position_model(cube: "xr.Dataset") -> PositionModel:
    """Of a cube that `open_cube` opened. Raises RefusedError when it is no cube of an image."""
    geometry = model_of(cube)
    try:
        stated = PoseUncertainty.from_dict(own_json(cube.attrs["uncertainty"]))
    except (KeyError, ValueError, TypeError):
        stated = None
    if stated is not None and not np.any(stated.covariance):
        stated = None
    return PositionModel(str(cube.attrs.get("product", "")), geometry, stated, cube)


def read_position_model(path: Path) -> PositionModel:
    """Of a product's folder, or its cube. Raises RefusedError when there is none, or it is damaged."""
    folder = path.parent if path.name == CUBE else path
    if not (folder / CUBE).is_dir():
        if not folder.exists():
            raise RefusedError(Reason.PRODUCT_MISSING, f"there is no {path}.", "Give the folder of a product.")
        raise no_cube_in(folder)
    with reading_product(folder):
        return position_model(open_cube(folder / CUBE))
