"""What each image says of cells of the ground, from which law and levels are found."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from tasks.mosaic.settings import MosaicSettings
from tasks.mosaic.view import View, ground_at, seen_from
from tasks.project.points import body_points, latitude_longitude

Array = NDArray[np.float64]
FEWEST_PIXELS = 4


@dataclass(frozen=True)
class Samples:
    """n means of an image over a cell of the ground. image, cell (n,): which; value: brightness; mu0, mu, phase_deg: of
    the mean; noise (n,): relative 1-sigma by noise and pose. images: how many there are."""

    image: NDArray[np.intp]
    cell: NDArray[np.intp]
    value: Array
    mu0: Array
    mu: Array
    phase_deg: Array
    noise: Array
    images: int


def samples_of(views: Sequence[View], settings: MosaicSettings) -> Samples:
    """Samples of all images, of cells of about equal area; of usable pixels within the limits of the angles."""
    parts = [_of_one(view, settings) for view in views]
    image = np.concatenate([np.full(len(part[0]), k) for k, part in enumerate(parts)])
    cell, value, mu0, mu, phase_deg, noise = (np.concatenate([part[k] for part in parts]) for k in range(6))
    return Samples(image, cell.astype(np.intp), value, mu0, mu, phase_deg, noise, len(views))


def _of_one(view: View, settings: MosaicSettings) -> tuple[Array, ...]:
    """Cell, value, mu0, mu, phase, relative noise."""
    y, x = np.nonzero(view.usable)
    places = np.stack([x + view.corner_px[0], y + view.corner_px[1]], axis=-1).astype(np.float64)
    points = body_points(view.pose, view.camera, view.target, places)
    latitude, longitude = latitude_longitude(points)
    on_body = np.isfinite(points[:, 0])
    x, y, latitude, longitude = x[on_body], y[on_body], latitude[on_body], longitude[on_body]
    seen = seen_from(view.pose, view.camera, ground_at(view.target, latitude, longitude))
    kept = (seen.mu0 >= np.cos(np.radians(settings.max_incidence_deg))) & (
        seen.mu >= np.cos(np.radians(settings.max_emission_deg))
    )
    x, y = x[kept], y[kept]
    if not len(x):
        return tuple(np.empty(0) for _ in range(6))
    cells, cell = np.unique(_cells(latitude[kept], longitude[kept], settings.cell_deg), return_inverse=True)
    count = np.bincount(cell)

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(cell, values, minlength=len(cells)) / count)

    value = mean(view.image[y, x].astype(np.float64))
    displacement = np.hypot(view.still_px, view.turning_px * seen.mu[kept])
    by_pose = mean(view.steep[y, x] * displacement)  # neighbours move together
    error = np.hypot(view.noise / np.sqrt(count), by_pose)
    good = (value > 3 * error) & (count >= min(FEWEST_PIXELS, _pixels_per_cell(view.camera, view, settings) / 2))
    parts = (cells, value, mean(seen.mu0[kept]), mean(seen.mu[kept]), mean(seen.phase_deg[kept]), error / value)
    return tuple(part[good].astype(np.float64) for part in parts)


def _pixels_per_cell(camera: Camera, view: View, settings: MosaicSettings) -> float:
    above = np.linalg.norm(view.pose.spacecraft_in_body_km) - view.target.mean_radius_km
    side = np.radians(settings.cell_deg) * view.target.mean_radius_km
    return float((side * camera.focal_length_px / max(above, 1.0)) ** 2)


def _cells(latitude: Array, longitude: Array, cell_deg: float) -> NDArray[np.intp]:
    """A number for each cell: rows of `cell_deg`, a whole number of cells about as wide as high in each."""
    row = np.minimum(np.floor((latitude + 90) / cell_deg), np.ceil(180 / cell_deg) - 1)
    around = np.maximum(np.round(360 / cell_deg * np.cos(np.radians((row + 0.5) * cell_deg - 90))), 1)
    return (row * 100_000 + np.floor(longitude / 360 * around)).astype(np.intp)
