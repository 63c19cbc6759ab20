"""The target's surface under every sub-pixel, in closed form, and how its albedo changes when the body is turned."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from tasks.compiled import compiled_reordered
from tasks.geometry.bilinear import bilinear
from tasks.geometry.unit_sphere import closest_approach
from tasks.simulate import Scene
from tasks.simulate.coarse_map import map_as_coarse_as
from tasks.simulate.window import Window

Image = NDArray[np.float32]


@dataclass(frozen=True)
class FineSurface:
    """Sub-pixels (ny*s, nx*s): cover, the fraction that the target fills; cosines of incidence and emission (0 off the
    body and at night); albedo; and its change per degree of turn about each body axis (3, ny*s, nx*s), both 0 at night.

    Sub-pixels on the limb are filled in part and carry the limb's own cosines and albedo: counting only those whose
    centre hits the body would let the limb jump by a share of a sub-pixel.
    """

    cover: Image
    mu0: Image
    mu: Image
    albedo: Image
    albedo_per_deg: Image


def fine_surface(scene: Scene, pose: Pose, window: Window, oversample: int) -> FineSurface:
    """Intersect the rays of an s x s grid of sub-pixels of `window` with the ellipsoid, in double precision."""
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
        scene.basemap.left_edge_deg,
        half_step,
        pixel_rad,
        (cover, mu0, mu, value, change),
    )
    return FineSurface(cover, mu0, mu, value, change)


@compiled_reordered
def _trace(first, step, to_scaled, spacecraft, radii, sun, albedo, left_edge_deg, half_step, pixel_rad, out):  # type: ignore[no-untyped-def]
    """Rays through the sub-pixels, in the body frame whose axes are scaled so that the target is the unit sphere."""
    cover, mu0, mu, value, change = out
    rows, columns = cover.shape
    map_rows, map_columns = albedo.shape
    c = spacecraft @ spacecraft - 1.0
    along_x, along_y = to_scaled[:, 0].copy(), to_scaled[:, 1].copy()
    per_u, per_v = 2 * (along_x @ spacecraft), 2 * (along_y @ spacecraft)
    ox, oy, oz = spacecraft[0], spacecraft[1], spacecraft[2]
    rx, ry, rz = radii[0], radii[1], radii[2]
    inverse_x, inverse_y, inverse_z = 1 / rx, 1 / ry, 1 / rz
    columns_per_rad, rows_per_rad = map_columns / (2 * np.pi), map_rows / np.pi
    left_edge_rad = np.radians(left_edge_deg)
    degree = np.pi / 180
    for i in range(rows):
        v = first[1] + i * step
        for j in range(columns):
            u = first[0] + j * step
            dx = along_x[0] * u + along_y[0] * v + to_scaled[0, 2]
            dy = along_x[1] * u + along_y[1] * v + to_scaled[1, 2]
            dz = along_x[2] * u + along_y[2] * v + to_scaled[2, 2]
            b = dx * ox + dy * oy + dz * oz
            if b >= 0:
                continue
            # The ray hits where b^2 - q c > 0, with q = d.d, b = d.o; its gradient in (u, v) gives the limb's distance.
            nearest_x, nearest_y, nearest_z, half_chord2, q = closest_approach(ox, oy, oz, dx, dy, dz)
            inside = half_chord2 * q
            slope_u = b * per_u - 2 * c * (along_x[0] * dx + along_x[1] * dy + along_x[2] * dz)
            slope_v = b * per_v - 2 * c * (along_y[0] * dx + along_y[1] * dy + along_y[2] * dz)
            slope = np.sqrt(slope_u * slope_u + slope_v * slope_v)
            distance = inside / (slope * step)
            if distance <= -0.5:
                continue
            filled = min(distance + 0.5, 1.0)
            cover[i, j] = filled
            if distance < 0.5:
                # In the middle of the part that is filled: the limb's own emission would be met by no part of it.
                inside = 0.5 * filled * slope * step
            t = -np.sqrt(inside) / q
            sx, sy, sz = nearest_x + t * dx, nearest_y + t * dy, nearest_z + t * dz
            length = 1 / np.sqrt(sx * sx + sy * sy + sz * sz)
            sx, sy, sz = sx * length, sy * length, sz * length
            nx, ny, nz = sx * inverse_x, sy * inverse_y, sz * inverse_z
            n = 1 / np.sqrt(nx * nx + ny * ny + nz * nz)
            nx, ny, nz = nx * n, ny * n, nz * n
            incidence = nx * sun[0] + ny * sun[1] + nz * sun[2]
            ex, ey, ez = dx * rx, dy * ry, dz * rz
            e = 1 / np.sqrt(ex * ex + ey * ey + ez * ez)
            ex, ey, ez = ex * e, ey * e, ez * e
            emission = -(nx * ex + ny * ey + nz * ez)
            mu[i, j] = max(emission, 0.0)
            if incidence <= 0:
                continue
            mu0[i, j] = incidence
            px, py, pz = sx * rx, sy * ry, sz * rz
            flat = max(np.sqrt(px * px + py * py), 1e-6)
            far = np.sqrt(flat * flat + pz * pz)
            around = np.arctan2(py, px) - left_edge_rad
            x = (around - 2 * np.pi * np.floor(around / (2 * np.pi))) * columns_per_rad - 0.5
            y = (0.5 * np.pi - np.arctan2(pz, flat)) * rows_per_rad - 0.5
            # Near the limb a sub-pixel covers a long strip of ground, away from the spacecraft: average along it.
            total, strips = 0.0, 1
            if emission < 0.3:
                strips = int(min(0.6 / max(emission, 0.06), 10.0))
            if strips > 1:
                ux, uy, uz = -ex - emission * nx, -ey - emission * ny, -ez - emission * nz
                east = (-py * ux + px * uy) / flat
                north = (-(px * ux + py * uy) * pz / flat + flat * uz) / far
                reach = 0.5 * pixel_rad * min(1 / max(emission, 0.06), 16.0)
                strip_x = reach * east * far / flat * columns_per_rad
                strip_y = -reach * north * rows_per_rad
                for k in range(strips):
                    at = (2 * k + 1.0) / strips - 1.0
                    total += bilinear(albedo, x + at * strip_x, y + at * strip_y)
                value[i, j] = total / strips
            else:
                value[i, j] = bilinear(albedo, x, y)
            # Per radian of longitude and latitude; then by the places that a turn of the body brings under the ray.
            stretch = min(half_step * far / flat, map_columns / 8.0)
            per_longitude = (bilinear(albedo, x + stretch, y) - bilinear(albedo, x - stretch, y)) / (2 * stretch)
            per_longitude *= columns_per_rad
            per_latitude = (bilinear(albedo, x, y - half_step) - bilinear(albedo, x, y + half_step)) / (2 * half_step)
            per_latitude *= rows_per_rad
            change[0, i, j] = degree * (per_longitude * px * pz / (flat * flat) - per_latitude * py / flat)
            change[1, i, j] = degree * (per_longitude * py * pz / (flat * flat) + per_latitude * px / flat)
            change[2, i, j] = -degree * per_longitude
