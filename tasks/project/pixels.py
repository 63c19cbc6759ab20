"""What single pixels see, wherever they are: the projection in plain numpy, for places that form no grid.

It serves frames whose pixels stay on the detector and whose geometry goes through a distortion model; on a grid it is
the yardstick of the compiled projection.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.backplanes import PLANES, Array
from tasks.project.rays import intersect, rays_of
from tasks.project.seen import Seen, scattered
from tasks.project.shaped import mesh_seen_at


def project_pixels(
    pose: Pose, camera: Camera, target: Target, xy_px: ArrayLike, planes: Sequence[str] = PLANES
) -> dict[str, Array]:
    """What the undistorted pixels `xy_px` (..., 2) see: each of `planes` (some of KNOWN_PLANES) as (...), NaN off the
    body and where a place is NaN. Angles in degrees, lengths in km; resolution_km is that of an undistorted pixel.

    Raises RefusedError when the pose puts spacecraft or Sun inside the target.
    """
    on_body, seen = seen_at(pose, camera, target, xy_px)
    return scattered(on_body, seen, planes)


def seen_at(
    pose: Pose, camera: Camera, target: Target, xy_px: ArrayLike, shadows: bool = False
) -> tuple[NDArray[np.bool_], Seen]:
    """Which of the undistorted pixels (..., 2) see the body (...), and the points that those see. shadows: of a shape
    model on itself, too."""
    if target.shape is not None:
        return mesh_seen_at(pose, camera, target, np.asarray(xy_px, dtype=np.float64), shadows)
    rays, xy = rays_of(pose, camera, target), np.asarray(xy_px, dtype=np.float64)
    scaled = intersect(rays, xy)
    on_body = np.isfinite(scaled[..., 0])
    scaled, radii = scaled[on_body], np.asarray(target.radii_km)
    return on_body, Seen(pose, camera, target, scaled * radii, scaled / radii, -rays.apparent_at(xy[on_body]))
