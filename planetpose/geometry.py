"""Between the pixels of an image and places on the body, both ways."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.backplanes import PLANES
from tasks.project.pixels import project_pixels
from tasks.project.places import pixels_of_places
from tasks.project.planes import project_planes
from tasks.publish.cube_model import CubeModel, model_of
from tasks.publish.variables import BY_NAME

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
UNITS = dict.fromkeys(("x_km", "y_km", "z_km"), "km")


def backplanes(
    pose: Pose,
    camera: Camera,
    target: Target,
    window: tuple[int, int, int, int] | None = None,
    planes: Sequence[str] = PLANES,
) -> "xr.Dataset":
    """What each pixel of a window sees: a dataset with the dimensions (y, x), float64, NaN off the body.

    window: (x0, y0, x1, y1), the half-open range of undistorted pixels; None is the whole frame. planes: some of
    latitude (planetocentric), longitude (east, 0 to 360), incidence, emission, phase (degrees), range_km, resolution_km
    (km: the longer side of a pixel's footprint), x_km, y_km, z_km (the surface point, body-fixed; not there unless
    requested). Coordinates x and y: the pixels, 0-based, integer at the centre, y down. Where the pose knows
    velocities, light time and stellar aberration are those of each pixel (SPICE's LT+S, to 1e-4 deg).

    Raises RefusedError where the pose puts spacecraft or Sun inside the target; ValueError for an unknown plane or an
    empty window.
    """
    import xarray as xr

    found = project_planes(pose, camera, target, window, planes)
    x0, y0, x1, y1 = found.window
    variables = {name: (("y", "x"), found[name], _attributes(name)) for name in planes}
    pixels = {"x": np.arange(x0, x1, dtype=np.int32), "y": np.arange(y0, y1, dtype=np.int32)}
    return xr.Dataset(variables, pixels, {"target": target.name, "camera": camera.name, "et": float(pose.et)})


def _attributes(name: str) -> dict[str, str]:
    if name not in BY_NAME:
        return {"units": UNITS.get(name, "1")}
    return {"long_name": BY_NAME[name].long_name, "units": BY_NAME[name].units}


def pixel_of(model: "xr.Dataset | CubeModel", latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> tuple[Array, Array]:
    """Where in the image places on the body are: (x, y), each of the shape that the arguments broadcast to.

    model: a cube that `open_cube` opened, or what `model_of` made of one, or a `CubeModel(pose, camera, target)`.
    latitude_deg: planetocentric; longitude_deg: east. Pixels are 0-based, with fractions, integer at the centre, y
    down; of a cube of raw pixels they are raw pixels. The place is computed from pose, camera and target, not looked up
    in the planes, so it is as exact as the pose. NaN for places that the body hides, that are behind the camera, or on
    no body; a place may lie outside an undistorted frame, and is NaN outside a raw one.

    Raises RefusedError for a dataset that is no cube, and for a pose inside the target.
    """
    known = _known(model)
    places = pixels_of_places(known.pose, known.camera, known.target, latitude_deg, longitude_deg)
    x, y = np.moveaxis(known.pixels_of(places), -1, 0)
    return x, y


def place_of(model: "xr.Dataset | CubeModel", x_px: ArrayLike, y_px: ArrayLike) -> tuple[Array, Array]:
    """What places of the image see: (planetocentric latitude, east longitude in [0, 360)), degrees, each of the shape
    that the arguments broadcast to; NaN off the body.

    model, pixels and errors as of `pixel_of`, whose inverse it is; at whole pixels it is what the planes latitude and
    longitude of the cube hold (in single precision).
    """
    known = _known(model)
    xy = np.stack(np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (x_px, y_px))), axis=-1)
    seen = project_pixels(known.pose, known.camera, known.target, known.undistorted_of(xy), ("latitude", "longitude"))
    return seen["latitude"], seen["longitude"]


def _known(model: "xr.Dataset | CubeModel") -> CubeModel:
    return model if isinstance(model, CubeModel) else model_of(model)
