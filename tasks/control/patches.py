"""Patches of the ground as images show them: on a plane that touches the body, north up, illumination divided out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.target import Target
from tasks.mosaic.view import Ground, View, seen_from
from tasks.photometry.laws import PhotometricLaw
from tasks.project.points import surface_points

Array = NDArray[np.float64]
ROWS_AT_ONCE = 20_000  # OpenCV's remap counts in 16 bits


@dataclass(frozen=True)
class Places:
    """k places: points (k, 3) km on the body, and the directions east and north (k, 3) there."""

    points: Array
    east: Array
    north: Array

    def part(self, chosen: NDArray[np.intp]) -> "Places":
        """Some of them."""
        return Places(self.points[chosen], self.east[chosen], self.north[chosen])

    def moved(self, target: Target, steps_km: Array) -> Array:
        """Points (k, ..., 3) on the body that lie (k, ..., 2) km east and north of the places."""
        extra = steps_km.ndim - 2
        wide = [part.reshape(len(part), *(1,) * extra, 3) for part in (self.points, self.east, self.north)]
        plane = wide[0] + steps_km[..., :1] * wide[1] + steps_km[..., 1:] * wide[2]
        return np.asarray(plane / np.linalg.norm(plane / np.asarray(target.radii_km), axis=-1, keepdims=True))


def places_on(target: Target, count: int) -> Places:
    """About evenly spread places (a Fibonacci lattice)."""
    number = np.arange(count) + 0.5
    latitude = np.degrees(np.arcsin(1 - 2 * number / count))
    longitude = np.mod(number * 360 * (3 - 5**0.5) / 2, 360)
    return places_at(target, surface_points(target, latitude, longitude))


def places_at(target: Target, points: Array) -> Places:
    """Places at points (k, 3) on the body."""
    normal = points / np.asarray(target.radii_km) ** 2
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    east = np.cross([0.0, 0.0, 1.0], normal)
    east /= np.maximum(np.linalg.norm(east, axis=-1, keepdims=True), 1e-12)
    return Places(points, east, np.cross(normal, east))


def patches_of(
    view: View, places: Places, step_km: Array, side: int, law: PhotometricLaw
) -> tuple[Array, NDArray[np.bool_]]:
    """Normalised brightness (k, side, side) of an image around places, rows from north to south, `step_km` (k,) apart;
    and which patches (k,) the image shows whole, lit and usable."""
    half = (side - 1) / 2
    offset = np.stack(np.meshgrid(np.arange(side) - half, half - np.arange(side)), axis=-1)
    points = places.moved(view.target, offset[None] * step_km[:, None, None, None])
    normals = points / np.asarray(view.target.radii_km) ** 2
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        seen = seen_from(view.pose, view.camera, Ground(points, normals))
        xy = seen.xy_px - np.asarray(view.corner_px)
        ny, nx = view.image.shape
        inside = (xy > 1).all(axis=-1) & (xy[..., 0] < nx - 2) & (xy[..., 1] < ny - 2)
        lit = (seen.mu0 > 0.1) & (seen.mu > 0.15)
    good = (inside & lit).all(axis=(1, 2))
    values = np.zeros((len(points), side, side))
    if not good.any():
        return values, good
    value, usable = _sampled(view, xy[good])
    incidence, emission = (np.degrees(np.arccos(np.clip(cosine[good], -1, 1))) for cosine in (seen.mu0, seen.mu))
    factor = law.normalising_factor(law.usual_values, incidence, emission, seen.phase_deg[good])
    values[good] = np.asarray(value, np.float64) * np.asarray(factor, np.float64)
    good[np.flatnonzero(good)[~usable.all(axis=(1, 2))]] = False
    return values, good


def _sampled(view: View, xy: Array) -> tuple[Array, NDArray[np.bool_]]:
    import cv2

    shape = xy.shape[:-1]
    rows = xy.reshape(-1, shape[-1], 2).astype(np.float32)
    value, near = np.empty(rows.shape[:2], np.float32), np.empty(rows.shape[:2], np.float32)
    inside = view.usable.astype(np.float32)
    for top in range(0, len(rows), ROWS_AT_ONCE):
        part = slice(top, top + ROWS_AT_ONCE)
        value[part] = cv2.remap(view.image, rows[part, :, 0], rows[part, :, 1], cv2.INTER_CUBIC)
        near[part] = cv2.remap(inside, rows[part, :, 0], rows[part, :, 1], cv2.INTER_LINEAR)
    return value.reshape(shape).astype(np.float64), near.reshape(shape) > 0.999
