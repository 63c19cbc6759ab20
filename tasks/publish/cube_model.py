"""Pose, camera and target of a cube, and which of its pixels see a place of the undistorted frame."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera, camera_from_dict
from catalog.errors import RefusedError
from catalog.plain_files import own_json
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import Target

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
ROUNDS = 30  # each leaves a few hundredths of the error, the share by which distortion departs from a straight map
STILL_PX = 1e-6


@dataclass(frozen=True)
class CubeModel:
    """Geometry of an image.

    pose: corrected. camera: of the undistorted frame. target: radii, rotation, shape model. detector: None where pixels
    are those of the undistorted frame; else the places of a cube's raw pixels in it.
    """

    pose: Pose
    camera: Camera
    target: Target
    detector: "Detector | None" = None

    def undistorted_of(self, xy_px: ArrayLike) -> Array:
        """Places (..., 2) in the undistorted frame of the image's pixels (..., 2); NaN outside a raw frame."""
        xy = np.asarray(xy_px, dtype=np.float64)
        return xy if self.detector is None else self.detector.undistorted_of(xy)

    def pixels_of(self, xy_px: ArrayLike) -> Array:
        """Pixels (..., 2) of the image of places (..., 2) in the undistorted frame; NaN outside a raw frame."""
        xy = np.asarray(xy_px, dtype=np.float64)
        return xy if self.detector is None else self.detector.pixels_of(xy)


@dataclass(frozen=True)
class Detector:
    """places: (ny, nx, 2), the place in the undistorted frame of each raw pixel, NaN where it is not known. first_px:
    (x, y) of the first one."""

    places: Array
    first_px: tuple[float, float]

    def undistorted_of(self, xy_px: Array) -> Array:
        """See CubeModel; linear between the centres of raw pixels."""
        from scipy.ndimage import map_coordinates

        x, y = np.moveaxis(xy_px - np.asarray(self.first_px), -1, 0)
        found = [map_coordinates(self.places[..., i], [y, x], order=1, cval=np.nan) for i in range(2)]
        return np.stack(found, axis=-1)

    def pixels_of(self, xy_px: Array) -> Array:
        """See CubeModel: Newton's steps with the derivative of the straight map that is nearest to the distortion."""
        ny, nx = self.places.shape[:2]
        known = np.isfinite(self.places).all(axis=-1)
        if np.count_nonzero(known) < 3:
            return np.full(xy_px.shape, np.nan)
        ys, xs = np.nonzero(known)
        raw = np.column_stack([xs, ys]) + np.asarray(self.first_px)
        straight = np.linalg.lstsq(np.column_stack([self.places[known], np.ones(len(xs))]), raw, rcond=None)[0]
        low = np.asarray(self.first_px)
        high = low + np.array([nx - 1, ny - 1])
        pixels = xy_px @ straight[:2] + straight[2]
        step = np.zeros_like(pixels)
        for _ in range(ROUNDS):
            inside = np.clip(pixels, low, high)
            # Beyond the outermost centres the frame goes on straight.
            beyond = np.linalg.solve(straight[:2].T, (pixels - inside)[..., None])[..., 0]
            step = (xy_px - self.undistorted_of(inside) - beyond) @ straight[:2]
            pixels = pixels + step
            if not (np.abs(step) > STILL_PX).any():
                break
        on_frame = ((pixels >= low - 0.5) & (pixels <= high + 0.5)).all(axis=-1) & (np.abs(step) < 1e-3).all(axis=-1)
        return np.where(on_frame[..., None], pixels, np.nan)


def model_of(cube: "xr.Dataset") -> CubeModel:
    """Model of a cube that `open_cube` opened, or of a part of one. Raises RefusedError when it is no cube of an
    image, or its attributes are damaged."""
    try:
        camera, target, pose = models_in(cube.attrs)
    except (KeyError, ValueError, TypeError) as error:
        fault = f"the dataset {cube.attrs.get('product', '')} is no cube of an image ({type(error).__name__}: {error})."
        raise RefusedError(
            Reason.CUBE_WITHOUT_MODEL, fault, "Give what open_cube opens: cube.zarr of a product."
        ) from error
    if "place_x" not in cube:
        return CubeModel(pose, camera, target)
    places = np.stack([cube[name].values.astype(np.float64) for name in ("place_x", "place_y")], axis=-1)
    return CubeModel(pose, camera, target, Detector(places, (float(cube["x"][0]), float(cube["y"][0]))))


def models_in(attributes: Mapping[str, Any]) -> tuple[Camera, Target, Pose]:
    """Camera, target and corrected pose in a cube's attributes. Raises KeyError or ValueError."""
    camera = camera_from_dict(own_json(attributes["camera_model"]), "of the cube")
    target = Target.model_validate(own_json(attributes["target_model"]))
    return camera, target, Pose.from_dict(own_json(attributes["pose_after"]))
