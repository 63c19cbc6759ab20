"""A small picture of an image, cut to its target."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalog.observation import Quality
from tasks.pictures.product import opened_cube
from tasks.publish.overlay import stretched

if TYPE_CHECKING:
    import xarray as xr

SIDE_PX = 128
MARGIN = 0.08


def write_thumbnail(folder: Path, path: Path) -> Path:
    """Write a square PNG of the product in `folder` and return its path. Raises RefusedError without a cube."""
    with opened_cube(folder) as cube:
        path.write_bytes(thumbnail_of(cube))
    return path


def thumbnail_of(cube: "xr.Dataset") -> bytes:
    """The square PNG of a cube's image; of the whole frame where no pixel is known to be off the body."""
    import cv2

    image, quality = cube["image"].values, cube["quality"].values
    shown = (255 * stretched(image)).astype(np.uint8)
    rows, columns = np.nonzero((quality & np.uint16(Quality.OFF_BODY)) == 0)
    if rows.size:
        middle = (rows.min() + rows.max()) // 2, (columns.min() + columns.max()) // 2
        half = int((0.5 + MARGIN) * max(np.ptp(rows), np.ptp(columns))) + 2
    else:
        middle, half = (image.shape[0] // 2, image.shape[1] // 2), max(image.shape) // 2
    padded = np.pad(shown, half)
    square = padded[middle[0] : middle[0] + 2 * half + 1, middle[1] : middle[1] + 2 * half + 1]
    small = cv2.resize(square, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".png", small)[1])
