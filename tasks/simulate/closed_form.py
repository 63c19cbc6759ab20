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
from tasks.geometry.bilinear import bilinear, places_on_map
from tasks.geometry.row_cosines import emission_cosines, incidence_cosines
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
        float(basemap.left_edge_deg) % 360.0,
        (hit, mu0, mu, value),
    )
    return hit, mu0, mu, value


@compiled_reordered
def _fill(first, step, to_scaled, spacecraft, radii, sun, albedo, left_edge_deg, out):  # type: ignore[no-untyped-def]
    """In the body frame whose axes are scaled so that the target is the unit sphere. Each loop over a row's columns
    does a part that the compiler can vectorise; the last one looks up the map."""
    hit, mu0, mu, value = out
    rows, columns = hit.shape
    px, py, pz, flat = np.empty(columns), np.empty(columns), np.empty(columns), np.empty(columns)
    x, y, chord2 = np.empty(columns), np.empty(columns), np.empty(columns)
    ox, oy, oz = spacecraft[0], spacecraft[1], spacecraft[2]
    ux, uy, uz = to_scaled[0, 0], to_scaled[1, 0], to_scaled[2, 0]
    rx, ry, rz = radii[0], radii[1], radii[2]
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
        # Few arrays in each loop: the compiler must know that none overlaps another. Indices count from 0: of others it
        # would have to ask whether they are negative.
        size, first_u, seen2 = end - begin, first[0] + begin * step, chord2[begin:end]
        for j in range(size):
            u = first_u + j * step
            dx, dy, dz = vx + ux * u, vy + uy * u, vz + uz * u
            cx, cy, cz, _, length2 = closest_approach(ox, oy, oz, dx, dy, dz)
            t = math.sqrt(max(seen2[j], 0.0) / length2)
            px[j], py[j], pz[j] = (cx - t * dx) * rx, (cy - t * dy) * ry, (cz - t * dz) * rz
        emission_cosines(px, py, pz, first_u, step, (vx, vy, vz), (ux, uy, uz), radii, mu[i, begin:end])
        incidence_cosines(px, py, pz, sun, radii, mu0[i, begin:end])
        for j in range(size):
            flat[j] = math.sqrt(px[j] * px[j] + py[j] * py[j])
        places_on_map(px, py, pz, flat, left_edge_deg, albedo, x[:size], y[:size])
        hit[i, begin:end] = True
        values = value[i, begin:end]
        for j in range(size):
            values[j] = bilinear(albedo, x[j], y[j])
