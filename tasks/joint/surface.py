"""The target's surface under every sub-pixel, in closed form, and how its albedo changes when the body is turned."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from tasks.compiled import compiled_reordered
from tasks.geometry.bilinear import bilinear, places_on_map
from tasks.geometry.row_cosines import emission_cosines, incidence_cosines
from tasks.geometry.unit_sphere import closest_approach
from tasks.simulate import Scene
from tasks.simulate.coarse_map import map_as_coarse_as
from tasks.simulate.window import Window

Image = NDArray[np.float32]


@dataclass(frozen=True)
class FineSurface:
    """Sub-pixels (ny*s, nx*s): cover, the fraction that the target fills; cosines of incidence and emission (0 off the
    body and at night); albedo; and its change per degree of turn about each body axis (3, ny*s, nx*s), both 0 at night
    unless it was wanted.

    Sub-pixels on the limb are filled in part and carry the limb's own cosines and albedo: counting only those whose
    centre hits the body would let the limb jump by a share of a sub-pixel.
    """

    cover: Image
    mu0: Image
    mu: Image
    albedo: Image
    albedo_per_deg: Image


def fine_surface(scene: Scene, pose: Pose, window: Window, oversample: int, night: bool = False) -> FineSurface:
    """Intersect the rays of an s x s grid of sub-pixels of `window` with the ellipsoid, in double precision. night:
    albedo there, too (other bodies light it)."""
    camera, radii = scene.camera, np.asarray(scene.target.radii_km, np.float64)
    rows, columns = (n * oversample for n in window.shape)
    pixel_rad = pose.range_km / camera.focal_length_px / scene.target.mean_radius_km / oversample
    albedo = map_as_coarse_as(scene.basemap, pixel_rad)
    # A difference over about one sub-pixel: finer than what is seen, coarser than the map's own steps.
    half_step = max(pixel_rad * albedo.shape[0] / np.pi, 0.5)
    cover, mu0, mu, value = (np.zeros((rows, columns), np.float32) for _ in range(4))
    change = np.zeros((3, rows, columns), np.float32)
    first = (
        (window.x0 - 0.5 + 0.5 / oversample - camera.centre_px[0]) / camera.focal_length_px,
        (window.y0 - 0.5 + 0.5 / oversample - camera.centre_px[1]) / camera.focal_length_px,
    )
    step = 1 / (oversample * camera.focal_length_px)
    _trace(
        np.array(first),
        step,
        pose.camera_from_body.T / radii[:, None],
        pose.spacecraft_in_body_km / radii,
        radii,
        np.asarray(pose.sun_direction_in_body),
        albedo,
        float(scene.basemap.left_edge_deg) % 360.0,
        half_step,
        pixel_rad,
        night,
        (cover, mu0, mu, value, change),
    )
    return FineSurface(cover, mu0, mu, value, change)


@compiled_reordered
def _trace(first, step, to_scaled, spacecraft, radii, sun, albedo, left_edge_deg, half_step, pixel_rad, night, out):  # type: ignore[no-untyped-def]
    """Rays through the sub-pixels, in the body frame whose axes are scaled so that the target is the unit sphere. Each
    loop over a row's columns does a part that the compiler can vectorise; the last one looks up the map."""
    cover, mu0, mu, value, change = out
    rows, columns = cover.shape
    c = spacecraft @ spacecraft - 1.0
    along_x, along_y = to_scaled[:, 0].copy(), to_scaled[:, 1].copy()
    per_u, per_v = 2 * (along_x @ spacecraft), 2 * (along_y @ spacecraft)
    ox, oy, oz = spacecraft[0], spacecraft[1], spacecraft[2]
    ax, ay, az = along_x[0], along_x[1], along_x[2]
    bx, by, bz = along_y[0], along_y[1], along_y[2]
    rx, ry, rz = radii[0], radii[1], radii[2]
    inverse2_x, inverse2_y, inverse2_z = 1 / (rx * rx), 1 / (ry * ry), 1 / (rz * rz)
    map_rows, map_columns = albedo.shape
    columns_per_rad, rows_per_rad = map_columns / (2 * np.pi), map_rows / np.pi
    degree = np.pi / 180
    inside, x, y = np.empty(columns), np.empty(columns), np.empty(columns)
    px, py, pz, flat = np.empty(columns), np.empty(columns), np.empty(columns), np.empty(columns)
    for i in range(rows):
        v = first[1] + i * step
        # The direction at u = 0.
        vx, vy, vz = bx * v + to_scaled[0, 2], by * v + to_scaled[1, 2], bz * v + to_scaled[2, 2]
        for j in range(columns):
            u = first[0] + j * step
            dx, dy, dz = vx + ax * u, vy + ay * u, vz + az * u
            b = dx * ox + dy * oy + dz * oz
            # The ray hits where b^2 - q c > 0, with q = d.d, b = d.o; its gradient in (u, v) gives the limb's distance.
            cx, cy, cz, half_chord2, q = closest_approach(ox, oy, oz, dx, dy, dz)
            hits = half_chord2 * q
            slope_u = b * per_u - 2 * c * (ax * dx + ay * dy + az * dz)
            slope_v = b * per_v - 2 * c * (bx * dx + by * dy + bz * dz)
            slope = math.sqrt(slope_u * slope_u + slope_v * slope_v) * step
            distance = hits / slope if b < 0 else -1.0
            filled = min(max(distance + 0.5, 0.0), 1.0)
            cover[i, j] = filled
            # In the middle of the part that is filled: the limb's own emission would be met by no part of it.
            inside[j] = 0.5 * filled * slope if distance < 0.5 else hits
        begin, end = 0, columns
        while begin < end and cover[i, begin] <= 0:
            begin += 1
        while end > begin and cover[i, end - 1] <= 0:
            end -= 1
        # Few arrays in each loop: the compiler must know that none overlaps another. Indices count from 0: of others it
        # would have to ask whether they are negative.
        size, first_u = end - begin, first[0] + begin * step
        within, mu_here, mu0_here = inside[begin:end], mu[i, begin:end], mu0[i, begin:end]
        value_here, change_here = value[i, begin:end], change[:, i, begin:end]
        for j in range(size):
            u = first_u + j * step
            dx, dy, dz = vx + ax * u, vy + ay * u, vz + az * u
            cx, cy, cz, half_chord2, q = closest_approach(ox, oy, oz, dx, dy, dz)
            t = -math.sqrt(within[j]) / q
            sx, sy, sz = cx + t * dx, cy + t * dy, cz + t * dz
            length = 1 / math.sqrt(sx * sx + sy * sy + sz * sz)
            px[j], py[j], pz[j] = sx * length * rx, sy * length * ry, sz * length * rz
        emission_cosines(px, py, pz, first_u, step, (vx, vy, vz), (ax, ay, az), radii, mu_here)
        incidence_cosines(px, py, pz, sun, radii, mu0_here)
        for j in range(size):
            flat[j] = max(math.sqrt(px[j] * px[j] + py[j] * py[j]), 1e-6)
        places_on_map(px, py, pz, flat, left_edge_deg, albedo, x[:size], y[:size])
        for j in range(size):
            if mu0_here[j] <= 0 and not night:
                continue
            at_x, at_y, emission = x[j], y[j], np.float64(mu_here[j])
            cosine, sine, tangent = px[j] / flat[j], py[j] / flat[j], pz[j] / flat[j]
            stretch = math.sqrt(1 + tangent * tangent)
            # Near the limb a sub-pixel covers a long strip of ground, away from the spacecraft: average along it.
            strips = int(min(0.6 / max(emission, 0.06), 10.0)) if emission < 0.3 else 1
            if strips > 1:
                u = first_u + j * step
                ex, ey, ez = (vx + ax * u) * rx, (vy + ay * u) * ry, (vz + az * u) * rz
                e = 1 / math.sqrt(ex * ex + ey * ey + ez * ez)
                nx, ny, nz = px[j] * inverse2_x, py[j] * inverse2_y, pz[j] * inverse2_z
                n = emission / math.sqrt(nx * nx + ny * ny + nz * nz)
                ux, uy, uz = -ex * e - nx * n, -ey * e - ny * n, -ez * e - nz * n
                reach = 0.5 * pixel_rad * min(1 / max(emission, 0.06), 16.0)
                east = reach * (uy * cosine - ux * sine) * stretch * columns_per_rad
                north = reach * (uz - (ux * cosine + uy * sine) * tangent) / stretch * rows_per_rad
                total = 0.0
                for k in range(strips):
                    at = (2 * k + 1.0) / strips - 1.0
                    total += bilinear(albedo, at_x + at * east, at_y - at * north)
                value_here[j] = total / strips
            else:
                value_here[j] = bilinear(albedo, at_x, at_y)
            # Per radian of longitude and latitude; then by the places that a turn of the body brings under the ray.
            wide = min(half_step * stretch, map_columns / 8.0)
            per_longitude = (bilinear(albedo, at_x + wide, at_y) - bilinear(albedo, at_x - wide, at_y)) / (2 * wide)
            per_longitude *= columns_per_rad
            above, below = bilinear(albedo, at_x, at_y - half_step), bilinear(albedo, at_x, at_y + half_step)
            per_latitude = (above - below) / (2 * half_step) * rows_per_rad
            change_here[0, j] = degree * (per_longitude * cosine * tangent - per_latitude * sine)
            change_here[1, j] = degree * (per_longitude * sine * tangent + per_latitude * cosine)
            change_here[2, j] = -degree * per_longitude
