"""The ellipsoid under every sub-pixel in closed form, double precision: a compiled loop over rows.

What it gives for a sub-pixel is what `mitsuba_geometry` and `surface_loop` give together, some fifty times faster; the
tests hold the two against each other.
"""

import math

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import BaseMap
from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.compiled import compiled_reordered
from tasks.geometry.arctangent import atan2_deg
from tasks.geometry.bilinear import bilinear
from tasks.geometry.unit_sphere import closest_approach
from tasks.simulate.window import Window

Image = NDArray[np.float32]


def ellipsoid_surface(
    pose: Pose, camera: Camera, target: Target, basemap: BaseMap, window: Window, oversample: int
) -> tuple[NDArray[np.bool_], Image, Image, Image]:
    """Hit, cosine of incidence (0 at night), of emission, and albedo (ny*s, nx*s) at the centres of an s x s grid of
    sub-pixels of `window`; 0 where the ray misses."""
    rows, columns = (n * oversample for n in window.shape)
    radii = np.asarray(target.radii_km, np.float64)
    hit = np.zeros((rows, columns), np.bool_)
    mu0, mu, value = (np.zeros((rows, columns), np.float32) for _ in range(3))
    half = 0.5 - 0.5 / oversample
    first = np.array([window.x0 - half - camera.centre_px[0], window.y0 - half - camera.centre_px[1]])
    _fill(
        first / camera.focal_length_px,
        1 / (oversample * camera.focal_length_px),
        pose.camera_from_body.T / radii[:, None],
        pose.spacecraft_in_body_km / radii,
        radii,
        np.asarray(pose.sun_direction_in_body, np.float64),
        np.ascontiguousarray(basemap.albedo, np.float32),
        float(basemap.left_edge_deg),
        (hit, mu0, mu, value),
    )
    return hit, mu0, mu, value


@compiled_reordered
def _fill(first, step, to_scaled, spacecraft, radii, sun, albedo, left_edge_deg, out):  # type: ignore[no-untyped-def]
    """In the body frame whose axes are scaled so that the target is the unit sphere. Each loop over a row's columns
    does a part that the compiler can vectorise; the last one looks up the map."""
    hit, mu0, mu, value = out
    rows, columns = hit.shape
    x, y, chord2 = np.empty(columns), np.empty(columns), np.empty(columns)
    ox, oy, oz = spacecraft[0], spacecraft[1], spacecraft[2]
    ux, uy, uz = to_scaled[0, 0], to_scaled[1, 0], to_scaled[2, 0]
    rx, ry, rz = radii[0], radii[1], radii[2]
    ix, iy, iz = 1 / rx, 1 / ry, 1 / rz
    columns_per_deg, rows_per_deg = albedo.shape[1] / 360.0, albedo.shape[0] / 180.0
    for i in range(rows):
        v = first[1] + i * step
        # The direction at u = 0.
        vx = to_scaled[0, 1] * v + to_scaled[0, 2]
        vy = to_scaled[1, 1] * v + to_scaled[1, 2]
        vz = to_scaled[2, 1] * v + to_scaled[2, 2]
        for j in range(columns):
            u = first[0] + j * step
            dx, dy, dz = vx + ux * u, vy + uy * u, vz + uz * u
            half_chord2 = closest_approach(ox, oy, oz, dx, dy, dz)[3]
            # Targets behind the camera are not seen.
            chord2[j] = half_chord2 if dx * ox + dy * oy + dz * oz < 0 else -1.0
        begin, end = 0, columns
        while begin < end and chord2[begin] <= 0:
            begin += 1
        while end > begin and chord2[end - 1] <= 0:
            end -= 1
        for j in range(begin, end):
            u = first[0] + j * step
            dx, dy, dz = vx + ux * u, vy + uy * u, vz + uz * u
            cx, cy, cz, half_chord2, length2 = closest_approach(ox, oy, oz, dx, dy, dz)
            t = math.sqrt(max(half_chord2, 0.0) / length2)
            sx, sy, sz = cx - t * dx, cy - t * dy, cz - t * dz
            nx, ny, nz = sx * ix, sy * iy, sz * iz
            n = 1 / math.sqrt(nx * nx + ny * ny + nz * nz)
            ex, ey, ez = dx * rx, dy * ry, dz * rz
            e = 1 / math.sqrt(ex * ex + ey * ey + ez * ez)
            seen = chord2[j] > 0
            incidence, emission = (nx * sun[0] + ny * sun[1] + nz * sun[2]) * n, -(nx * ex + ny * ey + nz * ez) * n * e
            hit[i, j] = seen
            mu0[i, j] = max(incidence, 0.0) if seen else 0.0
            mu[i, j] = max(emission, 0.0) if seen else 0.0
            px, py, pz = sx * rx, sy * ry, sz * rz
            east = atan2_deg(py, px) - left_edge_deg
            x[j] = (east - 360.0 * math.floor(east / 360.0)) * columns_per_deg - 0.5
            y[j] = (90.0 - atan2_deg(pz, math.sqrt(px * px + py * py))) * rows_per_deg - 0.5
        for j in range(begin, end):
            if hit[i, j]:
                value[i, j] = bilinear(albedo, x[j], y[j])
