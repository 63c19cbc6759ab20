"""How far lines of sight pass the target's ellipsoid: SPICE's NPEDLN, for arrays.

Along a line of sight the ellipsoid's outline is an ellipse, the shadow of diag(r^2) on the plane across; the distance
sought is that of a point of the plane from this ellipse.
"""

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.rays import dot
from tasks.project.sight import sight_of

Array = NDArray[np.float64]
BLOCK = 65536
ITERATIONS = 60


def limb_distance_km(pose: Pose, camera: Camera, target: Target, xy_px: Array) -> Array:
    """Distance (n,) of the lines of sight of undistorted pixels (n, 2) from the ellipsoid; 0 where they meet it.

    A line that leads away from the body is as far as the spacecraft: the nearest point of the half-line counts.
    """
    sight, radii = sight_of(pose, target), np.asarray(target.radii_km)
    distance = np.empty(len(xy_px))
    for start in range(0, len(xy_px), BLOCK):
        block = slice(start, start + BLOCK)
        offset = (xy_px[block] - np.asarray(camera.centre_px)) / camera.focal_length_px
        rays = np.concatenate([offset, np.ones_like(offset[:, :1])], axis=1) @ sight.body_from_camera.T
        distance[block] = _distances(sight.spacecraft_km, rays / np.sqrt(dot(rays, rays)), radii)
    return distance


def _distances(spacecraft_km: Array, directions: Array, radii: Array) -> Array:
    first = np.cross(directions, np.eye(3)[np.argmin(np.abs(directions), axis=1)])
    first /= np.sqrt(dot(first, first))
    second = np.cross(directions, first)
    place = np.stack([first @ spacecraft_km, second @ spacecraft_km], axis=1)
    xx, yy, xy = (np.sum(a * b * radii**2, axis=1) for a, b in ((first, first), (second, second), (first, second)))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    c, s = np.cos(angle), np.sin(angle)
    long2 = xx * c * c + 2 * xy * c * s + yy * s * s
    short2 = xx * s * s - 2 * xy * c * s + yy * c * c
    u, v = np.abs(c * place[:, 0] + s * place[:, 1]), np.abs(-s * place[:, 0] + c * place[:, 1])
    away = directions @ spacecraft_km > 0
    beside = _from_ellipse(np.sqrt(long2), np.sqrt(short2), u, v)
    return np.where(away, np.linalg.norm(spacecraft_km) - radii.mean(), beside)


def _from_ellipse(a: Array, b: Array, u: Array, v: Array) -> Array:
    """Distance (n,) of points (u, v) >= 0 from the ellipses with semi-axes a, b; 0 inside.

    The nearest point is (a^2 u / (t + a^2), b^2 v / (t + b^2)) with t >= 0 the root of
    (a u / (t + a^2))^2 + (b v / (t + b^2))^2 = 1, which is convex and falls: Newton from the left meets it.
    """
    t = np.maximum(0.0, np.maximum(a * u - a * a, b * v - b * b))
    for _ in range(ITERATIONS):
        p, q = a * u / (t + a * a), b * v / (t + b * b)
        slope = 2 * (p * p / (t + a * a) + q * q / (t + b * b))
        step = (p * p + q * q - 1.0) / np.maximum(slope, 1e-300)
        t = t + np.maximum(step, 0.0)
        if np.all(step <= 1e-14 * (t + b * b)):
            break
    near_u, near_v = a * a * u / (t + a * a), b * b * v / (t + b * b)
    return np.where((u / a) ** 2 + (v / b) ** 2 <= 1.0, 0.0, np.hypot(u - near_u, v - near_v))
