"""From a trusted pose to what every pixel sees: latitude, longitude, incidence, emission, phase, range, resolution."""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.rays import rays_of, sun_in_radii
from tasks.project.sight import sight_of

Array = NDArray[np.float64]
Window = tuple[int, int, int, int]

PLANES = ("latitude", "longitude", "incidence", "emission", "phase", "range_km", "resolution_km")
ANGLES = PLANES[:5]
POINT = ("x_km", "y_km", "z_km")  # the surface point, body-fixed
SUNLIT = "sunlit"  # of shape models only: 1 where the Sun's centre reaches, else 0
KNOWN_PLANES = PLANES + POINT
ROWS_PER_BLOCK = 32


@dataclass(frozen=True)
class Planes:
    """What the pixels of `window` see; each plane float64 (ny, nx), NaN off the body.

    window: (x0, y0, x1, y1), the half-open range of undistorted pixels. latitude (planetocentric), longitude (east,
    [0, 360)), incidence, emission (from the ellipsoid's normal) and phase in degrees. range_km: spacecraft to surface
    point. resolution_km: the longer side of a pixel's footprint, range / focal_length_px / cos(emission), as ISIS'
    oblique pixel resolution. x_km, y_km, z_km, on request: the surface point, body-fixed. A plane that was not asked
    for is a KeyError.
    """

    window: Window
    planes: Mapping[str, Array]

    def __getitem__(self, name: str) -> Array:
        return self.planes[name]

    @property
    def latitude(self) -> Array:
        """Planetocentric latitude, degrees."""
        return self.planes["latitude"]

    @property
    def longitude(self) -> Array:
        """East longitude in [0, 360), degrees."""
        return self.planes["longitude"]

    @property
    def incidence(self) -> Array:
        """Angle between the normal and the Sun, degrees; above 90 on the night side."""
        return self.planes["incidence"]

    @property
    def emission(self) -> Array:
        """Angle between the normal and the spacecraft, degrees."""
        return self.planes["emission"]

    @property
    def phase(self) -> Array:
        """Angle Sun - surface point - spacecraft, degrees."""
        return self.planes["phase"]

    @property
    def range_km(self) -> Array:
        """Distance from spacecraft to surface point, km."""
        return self.planes["range_km"]

    @property
    def resolution_km(self) -> Array:
        """Longer side of the pixel's footprint, km."""
        return self.planes["resolution_km"]

    @property
    def on_body(self) -> NDArray[np.bool_]:
        """Whether each pixel's centre sees the body (ny, nx)."""
        return np.isfinite(next(iter(self.planes.values())))

    @property
    def illuminated(self) -> NDArray[np.bool_]:
        """Whether each pixel's centre sees the day side (ny, nx): incidence below 90; on a shape model nothing in the
        Sun's way either, if the plane `sunlit` was asked for."""
        return self.planes[SUNLIT] > 0 if SUNLIT in self.planes else self.incidence < 90.0


def full_window(camera: Camera) -> Window:
    """The whole undistorted frame."""
    return (0, 0, *camera.size_px)


def project_planes(
    pose: Pose, camera: Camera, target: Target, window: Window | None = None, planes: Sequence[str] = PLANES
) -> Planes:
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
        from tasks.project.shaped import project_mesh_planes

        return project_mesh_planes(pose, camera, target, window, planes)
    out = np.empty((len(planes), y1 - y0, x1 - x0))
    _fill(pose, camera, target, window, planes, out)
    return Planes(window, dict(zip(planes, out, strict=True)))


def _fill(pose: Pose, camera: Camera, target: Target, window: Window, planes: Sequence[str], out: Array) -> None:
    from tasks.project.kernel import fill_rows

    rays, sight, radii = rays_of(pose, camera, target), sight_of(pose, target), np.array(target.radii_km)
    sun_km = sun_in_radii(pose, target) * radii
    slots = np.array([planes.index(name) if name in planes else -1 for name in KNOWN_PLANES])
    geometry = (np.ascontiguousarray(a) for a in (rays.anchor, rays.backward, rays.apparent, rays.limb_conic))
    light = np.array([sight.range_scale, sight.range_km, sight.turn_deg_per_km])
    fixed = (*geometry, radii, np.array(sight.spacecraft_km), sun_km, light, float(camera.focal_length_px))
    ny = out.shape[1]
    dx, dy = float(window[0] - rays.reference_px[0]), float(window[1] - rays.reference_px[1])

    def fill_block(row: int) -> None:
        fill_rows(*fixed, dx, dy, slots, (row, min(row + ROWS_PER_BLOCK, ny)), out)

    with ThreadPoolExecutor(_usable_cores()) as threads:
        list(threads.map(fill_block, range(0, ny, ROWS_PER_BLOCK)))


def _usable_cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
