"""The same projection in plain numpy: the yardstick of the compiled one, in tests and in the benchmark."""

from collections.abc import Sequence

import numpy as np

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.backplanes import PLANES, Backplanes, Window, full_window
from tasks.project.pixels import project_pixels


def project_planes_with_numpy(
    pose: Pose, camera: Camera, target: Target, window: Window | None = None, planes: Sequence[str] = PLANES
) -> Backplanes:
    """As `project_planes`, whole arrays at a time: the intersection for all pixels, the angles where they hit."""
    x0, y0, x1, y1 = window = window or full_window(camera)
    xy = np.stack(np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)), axis=-1).astype(np.float64)
    return Backplanes(window, project_pixels(pose, camera, target, xy, planes))
