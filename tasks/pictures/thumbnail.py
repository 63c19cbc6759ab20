"""A small picture of an image, cut to its target."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalog.observation import Quality
from tasks.pictures.product import opened_cube
from tasks.publish.cube import plane_values
from tasks.publish.overlay import grey_limits, greys

if TYPE_CHECKING:
    import xarray as xr

SIDE_PX = 128
MARGIN = 0.08
SAMPLED_PX = 256  # of each side, for the limits of the greys


def write_thumbnail(folder: Path, path: Path) -> Path:
    """Write a square PNG of the product in `folder` and return its path. Raises RefusedError without a cube."""
    with opened_cube(folder) as cube:
        path.write_bytes(thumbnail_of(cube))
    return path


def thumbnail_of(cube: "xr.Dataset") -> bytes:
    """The square PNG of a cube's image; of the whole frame where no pixel is known to be off the body."""
    import cv2

    image, quality = plane_values(cube, "image"), plane_values(cube, "quality")
    step = max(max(image.shape) // SAMPLED_PX, 1)
    low, high = grey_limits(image[::step, ::step])
    on_body = (quality & np.uint16(Quality.OFF_BODY)) == 0
    rows, columns = np.flatnonzero(on_body.any(axis=1)), np.flatnonzero(on_body.any(axis=0))
    if rows.size:
        middle = (rows[0] + rows[-1]) // 2, (columns[0] + columns[-1]) // 2
        half = int((0.5 + MARGIN) * max(np.ptp(rows), np.ptp(columns))) + 2
    else:
        middle, half = (image.shape[0] // 2, image.shape[1] // 2), max(image.shape) // 2
    square = np.full((2 * half + 1, 2 * half + 1), low, np.float32)
    first = [max(half - at, 0) for at in middle]  # of the square, where the frame begins
    part = image[tuple(slice(max(at - half, 0), at + half + 1) for at in middle)]
    square[first[0] : first[0] + part.shape[0], first[1] : first[1] + part.shape[1]] = np.nan_to_num(part, nan=low)
    small = cv2.resize(square, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".png", (255 * greys(small, low, high)).astype(np.uint8))[1])
