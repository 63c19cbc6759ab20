"""The projection onto the target's ellipsoid: whole rows by the compiled loop."""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.backplanes import KNOWN_PLANES, Array, Window
from tasks.project.rays import rays_of, sun_in_radii
from tasks.project.sight import sight_of

ROWS_PER_BLOCK = 32


def fill_planes(pose: Pose, camera: Camera, target: Target, window: Window, planes: Sequence[str], out: Array) -> None:
    """Fill `out` (planes, ny, nx) with the named planes of the pixels of `window` (see `planes.project_planes`)."""
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
