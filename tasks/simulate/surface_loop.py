"""From rendered surface points to cosines and albedo, compiled by numba: one pass over the sub-pixels."""

import math

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled
from tasks.geometry.bilinear import bilinear_at

Image = NDArray[np.float32]


@compiled
def sampled_surface(
    points: NDArray[np.float32],
    unit_km: float,
    radii_km: NDArray[np.float64],
    spacecraft_km: NDArray[np.float64],
    sun: NDArray[np.float64],
    albedo: Image,
    left_edge_deg: float,
) -> tuple[NDArray[np.bool_], Image, Image, Image]:
    """Hit, cosine of incidence (0 at night), of emission, and albedo (ny, nx) at body-fixed `points` (ny, nx, 3) in
    `unit_km`, which are zero where a ray misses. spacecraft_km, sun: (3,), from the target, body-fixed."""
    ny, nx = points.shape[:2]
    hit = np.zeros((ny, nx), np.bool_)
    mu0, mu, value = (np.zeros((ny, nx), np.float32), np.zeros((ny, nx), np.float32), np.zeros((ny, nx), np.float32))
    a, b, c = 1.0 / radii_km[0] ** 2, 1.0 / radii_km[1] ** 2, 1.0 / radii_km[2] ** 2
    for row in range(ny):
        for column in range(nx):
            x, y, z = points[row, column, 0], points[row, column, 1], points[row, column, 2]
            if x == 0 and y == 0 and z == 0:
                continue
            x, y, z = x * unit_km, y * unit_km, z * unit_km
            u, v, w = x * a, y * b, z * c
            n = 1.0 / math.sqrt(u * u + v * v + w * w)
            p, q, r = spacecraft_km[0] - x, spacecraft_km[1] - y, spacecraft_km[2] - z
            d = 1.0 / math.sqrt(p * p + q * q + r * r)
            hit[row, column] = True
            mu0[row, column] = max((u * sun[0] + v * sun[1] + w * sun[2]) * n, 0.0)
            mu[row, column] = max((u * p + v * q + w * r) * n * d, 0.0)
            latitude, longitude = math.atan2(z, math.sqrt(x * x + y * y)), math.atan2(y, x)
            value[row, column] = bilinear_at(albedo, left_edge_deg, math.degrees(latitude), math.degrees(longitude))
    return hit, mu0, mu, value
