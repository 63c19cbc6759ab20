"""The value of a map of the whole body between its pixels."""

import math

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled, compiled_reordered
from tasks.geometry.arctangent import atan2_deg

Array = NDArray[np.float64]


@compiled_reordered
def bilinear(albedo, x, y):  # type: ignore[no-untyped-def]
    """Value at column x (wrapped) and row y (held at the poles), 0-based, of a map (rows, columns)."""
    rows, columns = albedo.shape
    y = min(max(y, 0.0), rows - 1.0)
    left, top = int(np.floor(x)), int(y)
    fx, fy = x - left, y - top
    if left < 0 or left >= columns:
        left %= columns
    right, below = left + 1, min(top + 1, rows - 1)
    if right == columns:
        right = 0
    upper = albedo[top, left] * (1 - fx) + albedo[top, right] * fx
    lower = albedo[below, left] * (1 - fx) + albedo[below, right] * fx
    return upper * (1 - fy) + lower * fy


@compiled
def bilinear_at(albedo, left_edge_deg, latitude_deg, longitude_deg):  # type: ignore[no-untyped-def]
    """The same at planetocentric latitude and east longitude."""
    rows, columns = albedo.shape
    x = ((longitude_deg - left_edge_deg) % 360.0) * (columns / 360.0) - 0.5
    return bilinear(albedo, x, (90.0 - latitude_deg) * (rows / 180.0) - 0.5)


@compiled
def places_on_map(px, py, pz, flat, left_edge_deg, albedo, x, y):  # type: ignore[no-untyped-def]
    """Fill columns `x` (wrapped) and rows `y` (n,), 0-based, of an equirectangular map, at body-fixed points px, py, pz
    (n or more,), which are `flat` (n or more,) from the axis. left_edge_deg: 0 to 360."""
    columns_per_deg, rows_per_deg = albedo.shape[1] / 360.0, albedo.shape[0] / 180.0
    for j in range(len(x)):
        east = atan2_deg(py[j], px[j]) - left_edge_deg
        east = (east + 360.0) if east < 0.0 else east
        east = (east + 360.0) if east < 0.0 else east
        x[j] = east * columns_per_deg - 0.5
    for j in range(len(x)):
        y[j] = (90.0 - atan2_deg(pz[j], flat[j])) * rows_per_deg - 0.5


def map_values(albedo: NDArray[np.float32], left_edge_deg: float, latitude_deg: Array, longitude_deg: Array) -> Array:
    """Values (any shape) of an equirectangular map (rows, columns), as `catalog.basemap.BaseMap` has it, at
    planetocentric latitudes and east longitudes, degrees."""
    latitude, longitude = np.broadcast_arrays(np.asarray(latitude_deg, np.float64), np.asarray(longitude_deg))
    out = np.empty(latitude.size)
    flat = (np.ascontiguousarray(a, np.float64).ravel() for a in (latitude, longitude))
    _map_values(np.ascontiguousarray(albedo, np.float32), float(left_edge_deg), *flat, out)
    return out.reshape(latitude.shape)


@compiled
def _map_values(albedo, left_edge_deg, latitude_deg, longitude_deg, out):  # type: ignore[no-untyped-def]
    for i in range(out.size):
        out[i] = bilinear_at(albedo, left_edge_deg, latitude_deg[i], longitude_deg[i])


def values_towards(albedo: NDArray[np.float32], left_edge_deg: float, directions: Array) -> Array:
    """The same (n,) at body-fixed directions (n, 3) of any length."""
    px, py, pz = np.ascontiguousarray(directions.T, np.float64)
    out = np.empty(len(px))
    _values_towards(np.ascontiguousarray(albedo, np.float32), float(left_edge_deg) % 360.0, px, py, pz, out)
    return out


@compiled_reordered
def _values_towards(albedo, left_edge_deg, px, py, pz, out):  # type: ignore[no-untyped-def]
    flat, x, y = np.empty(len(out)), np.empty(len(out)), np.empty(len(out))
    for i in range(len(out)):
        flat[i] = max(math.sqrt(px[i] * px[i] + py[i] * py[i]), 1e-300)
    places_on_map(px, py, pz, flat, left_edge_deg, albedo, x, y)
    for i in range(len(out)):
        out[i] = bilinear(albedo, x[i], y[i])
