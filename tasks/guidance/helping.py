"""From what somebody drew on a page to the options of a correction: a start offset, a start pose, a mask."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.errors import RefusedError, WrongOptionError
from catalog.pose import Pose, write_pose_file
from tasks.atomic import file_put_in_place
from tasks.guidance.decisions import GUIDANCE
from tasks.joint.parameters import GROUPS, State
from tasks.publish.cube_model import CubeModel

RANGE_FACTORS = (0.2, 5.0)
SAME_PX = 1e-6
MARKS_AWAY_PX = 8  # of Voyager's vidicons from an even stretch, at most, within the frame's middle nine tenths


def start_options(
    store: Path,
    product: str,
    model: CubeModel,
    predicted: Pose,
    centre_px: tuple[float, float] | None,
    range_factor: float = 1.0,
    roll_deg: float = 0.0,
) -> dict[str, Any]:
    """Options of a `help` from where the target's centre is, in pixels of the image, how far it is compared with the
    prediction, and by how much it is rolled. A centre alone becomes `start_offset_px`; the others a pose, whose file
    is written beside the guidance, and `resume`. Raises WrongOptionError for values that make no pose."""
    low, high = RANGE_FACTORS
    if not low <= range_factor <= high or not abs(roll_deg) <= 360.0:
        fault = f"range factor {range_factor:g} or roll {roll_deg:g} deg is beyond what is sensible."
        raise WrongOptionError("help", fault, f"Range factors are {low:g} to {high:g}.")
    offset = np.zeros(2)
    here = model.camera.project(predicted.target_in_camera_km)
    if centre_px is not None:
        offset = model.undistorted_of(np.asarray(centre_px, dtype=np.float64)) - here
    if not np.isfinite(offset).all():
        fault = "the centre is nowhere in the frame, or the predicted one is behind the camera."
        raise WrongOptionError("help", fault, "Drag the disk to where it is seen.")
    if range_factor == 1.0 and roll_deg == 0.0:
        return {"start_offset_px": [round(float(v), 3) for v in offset]} if centre_px is not None else {}
    step = np.array([offset[0], offset[1], np.log(range_factor), roll_deg, 0.0, 0.0, 0.0, 0.0])
    pose = State(predicted, 1.0).moved(step, model.camera).pose
    path = Path(store) / GUIDANCE / f"{product}.pose.json"
    path.parent.mkdir(exist_ok=True)
    with file_put_in_place(path) as temporary:
        write_pose_file(pose, temporary)
    return {"resume": path.name}


def hold_options(groups: list[str]) -> dict[str, Any]:
    """Options that hold unknowns. Raises WrongOptionError for an unknown group."""
    unknown = [group for group in groups if group not in GROUPS]
    if unknown:
        raise WrongOptionError("hold", f"nothing is called {', '.join(unknown)}.", f"Known are {', '.join(GROUPS)}.")
    return {"hold": groups} if groups else {}


def mask_option(store: Path, product: str, model: CubeModel, painted: NDArray[np.bool_]) -> dict[str, Any]:
    """Option of a mask that was painted over the image (ny, nx), true where a pixel must not be used. It is written
    beside the guidance, in the raw frame that corrections begin with; there it is a pixel wider, for distortion is
    taken from the camera's nominal model. Raises WrongOptionError for a mask of another size or of everything."""
    from PIL import Image

    raw = painted if model.detector is not None else on_detector(model.camera, painted)
    if raw.all():
        raise WrongOptionError("mask", "the mask covers the whole image.", "Leave some of it.")
    if not raw.any():
        return {}
    path = Path(store) / GUIDANCE / f"{product}.mask.png"
    path.parent.mkdir(exist_ok=True)
    with file_put_in_place(path) as temporary:
        Image.fromarray(np.where(raw, np.uint8(255), np.uint8(0))).save(temporary, format="PNG")
    return {"mask": path.name}


def on_detector(camera: Camera, painted: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """A mask of the undistorted frame in the raw one, a pixel wider where the two differ."""
    import cv2

    if tuple(painted.shape[::-1]) != tuple(camera.size_px):
        (ny, nx), (width, height) = painted.shape, camera.size_px
        raise WrongOptionError("mask", f"the mask has {nx}x{ny} pixels, the image {width}x{height}.", "")
    width, height = camera.detector_size_px
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    xy, wider_px = np.stack([x, y], axis=-1), 1
    try:
        places = camera.project(camera.detector_ray(xy))
    except RefusedError:  # measured on the marks of each image: some pixels from evenly stretched
        stretch = np.array(camera.size_px) / np.array([width, height])
        places, wider_px = (xy + 0.5) * stretch - 0.5, MARKS_AWAY_PX
    if places.shape[:2] == painted.shape and np.abs(places - xy).max() < SAME_PX:
        return painted
    wider = cv2.dilate(painted.astype(np.uint8), np.ones((2 * wider_px + 1,) * 2, np.uint8))
    column, row = np.moveaxis(np.rint(np.nan_to_num(places, nan=-1.0)).astype(np.int64), -1, 0)
    inside = (column >= 0) & (column < painted.shape[1]) & (row >= 0) & (row < painted.shape[0])
    raw = np.zeros((height, width), dtype=np.bool_)
    raw[inside] = wider[row[inside], column[inside]] > 0
    return raw
