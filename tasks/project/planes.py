"""From a trusted pose to what every pixel sees: latitude, longitude, incidence, emission, phase, range, resolution."""

from collections.abc import Sequence

import numpy as np

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.backplanes import KNOWN_PLANES, PLANES, SUNLIT, Backplanes, Window, full_window
from tasks.project.ellipsoid import fill_planes
from tasks.project.shaped import project_mesh_planes


def project_planes(
    pose: Pose, camera: Camera, target: Target, window: Window | None = None, planes: Sequence[str] = PLANES
) -> Backplanes:
    """Project the pixels of `window` (default: the undistorted frame) onto the target's ellipsoid, or its shape model
    where it has one (see `shaped`); `planes` are some of KNOWN_PLANES.

    Paper, section 6 (with 1/r^2 on the quadric's diagonal), in closed form. The Sun is a point at its finite distance.
    Where the pose knows velocities, stellar aberration and light time are those of each pixel: SPICE's SINCPT, ILUMIN
    and RECLAT with LT+S, to 1e-4 deg (see `sight` and tests/real/test_project_real.py; emission and phase are counted
    from the apparent direction, as ILUMIN does, so emission may exceed 90 by v/c at the limb). One exception: ILUMIN
    takes the Sun in the frame of the centre's light time, so on a body as large and quick as Jupiter its incidence and
    phase are 0.0024 deg off; on moons that is below 2e-5 deg. Without velocities one fixed geometry serves the whole
    disk: SPICE's to 1e-9 deg with no corrections (`planetpose benchmark projection` measures it), off by 0.02 deg
    (emission below 80 deg) from what LT+S gives.

    Raises RefusedError when the pose puts spacecraft or Sun inside the target; ValueError for an unknown plane or an
    empty window.
    """
    unknown = set(planes) - set(KNOWN_PLANES) - ({SUNLIT} if target.shape is not None else set())
    if unknown or not planes:
        raise ValueError(
            f"unknown planes {sorted(unknown)}; known are {', '.join(KNOWN_PLANES)}, and at least one is needed"
        )
    window = window or full_window(camera)
    x0, y0, x1, y1 = window
    if x1 <= x0 or y1 <= y0:
        raise ValueError(f"window {window} is empty; it is (x0, y0, x1, y1) with x1 > x0 and y1 > y0")
    if target.shape is not None:
        return project_mesh_planes(pose, camera, target, window, planes)
    out = np.empty((len(planes), y1 - y0, x1 - x0))
    fill_planes(pose, camera, target, window, planes, out)
    return Backplanes(window, dict(zip(planes, out, strict=True)))
