"""One raw image, before it is written."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose


@dataclass(frozen=True)
class RawImage:
    """image (ny, nx): DN, line 0 first, y down; noise: 1-sigma; saturated, missing: masks. pose: what the file's label
    is to say, as far as the format holds it."""

    product: str
    camera: Camera
    target: str
    pose: Pose
    exposure_s: float
    image: NDArray[np.float32]
    noise: NDArray[np.float32]
    saturated: NDArray[np.bool_]
    missing: NDArray[np.bool_]
