"""How near a mosaic comes to the albedo that was planted in its images."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalog.basemap import BaseMap
from catalog.target import find_target
from lab.simulate.albedo_store import PlantedAlbedo
from tasks.geometry.bilinear import map_values

Array = NDArray[np.float64]
Figures = dict[str, Any]

# PSF (0.7 px), square pixel (0.29) and resampling of an image together, as a Gaussian, pixels: of 0.75, 0.9 and 1 the
# one that comes nearest to the mosaics of the paper's 57 views.
SMEARED_PX = 0.9


def blotches(seed: int = 5, shape: tuple[int, int] = (256, 512), widths: tuple[float, ...] = (4, 9)) -> BaseMap:
    """A random albedo of 12 % (1-sigma); widths: of its features, pixels (1-sigma)."""
    rng = np.random.default_rng(seed)
    field = sum(cv2.GaussianBlur(rng.standard_normal(shape), (0, 0), s) * s for s in widths)
    return BaseMap("blotches", (1 + 0.12 * field / np.std(field)).astype(np.float32), 0.0, "planted")


def exact_reflectance(dataset: xr.Dataset, albedo: BaseMap, planted: PlantedAlbedo) -> Array:
    """Reflectance (lat, lon) under the standard geometry at the centres of the mosaic's pixels."""
    latitude, longitude = np.meshgrid(dataset.lat.values, dataset.lon.values, indexing="ij")
    values = map_values(albedo.albedo, albedo.left_edge_deg, latitude, longitude)
    return np.asarray(values, np.float64) * planted.standard_reflectance()


def resolved_reflectance(dataset: xr.Dataset, exact: Array) -> Array:
    """The same as a mean over what the images resolve: a Gaussian of SMEARED_PX times `resolution_km` on the ground."""
    pixel_km = np.radians(180 / len(dataset.lat)) * find_target("europa").mean_radius_km
    cells = SMEARED_PX * np.nan_to_num(dataset.resolution_km.values) / pixel_km
    widths = np.arange(0, max(8.0, float(cells.max())) + 1.1, 0.5)
    part = np.clip(cells / 0.5, 0, len(widths) - 1.001)
    low = part.astype(int)
    stack = np.stack([smeared(exact, dataset.lat.values, width) for width in widths])
    row, column = np.indices(low.shape)
    return (1 - part + low) * stack[low, row, column] + (part - low) * stack[low + 1, row, column]


def smeared(values: Array, latitude_deg: Array, width: float) -> Array:
    """A map (lat, lon) under a Gaussian of `width` of its pixels (1-sigma) at the equator, as wide on the ground
    everywhere."""
    if width <= 0:
        return values
    wide = values.shape[1] // 4
    padded = np.pad(values, ((0, 0), (wide, wide)), mode="wrap")
    padded = cv2.GaussianBlur(padded, (0, 0), sigmaX=1e-6, sigmaY=width)
    along = np.minimum(width / np.cos(np.radians(latitude_deg)), wide / 4)
    rows = [
        cv2.GaussianBlur(row[None], (0, 0), sigmaX=each, sigmaY=1e-6)[0]
        for row, each in zip(padded, along, strict=True)
    ]
    return np.asarray(np.array(rows)[:, wide:-wide])


def mosaic_figures(dataset: xr.Dataset, albedo: BaseMap, planted: PlantedAlbedo) -> Figures:
    """gain; rms: relative, of reflectance over the resolved truth, `rms_at_pixel` over the exact one; within_1,
    within_2: shares of errors inside 1 and 2 sigma; seam: how much larger (RMS, relative) the reflectance's steps are
    where another image begins to weigh most than elsewhere; shown: share of the map. Pixels weigh by their area."""
    value, sigma = dataset.reflectance.values.astype(np.float64), dataset.sigma.values
    exact = exact_reflectance(dataset, albedo, planted)
    truth = resolved_reflectance(dataset, exact)
    shown = np.isfinite(value)
    area = np.broadcast_to(np.cos(np.radians(dataset.lat.values))[:, None], value.shape)[shown]
    gain = float(np.average(value[shown] / truth[shown], weights=area))

    def rms(against: Array) -> float:
        ratio = value[shown] / against[shown]
        return float(np.sqrt(np.average((ratio / np.average(ratio, weights=area) - 1) ** 2, weights=area)))

    pull = np.abs(value[shown] / gain - truth[shown]) / sigma[shown]
    return {
        "gain": gain,
        "rms": rms(truth),
        "rms_at_pixel": rms(exact),
        "within_1": float(np.average(pull < 1, weights=area)),
        "within_2": float(np.average(pull < 2, weights=area)),
        "seam": seam(dataset),
        "shown": float(np.mean(shown)),
    }


def seam(dataset: xr.Dataset) -> float:
    """Root of the mean square of the reflectance's relative steps from one pixel to the next eastward where the image
    of the largest weight changes, less that elsewhere."""
    index, value = dataset.image_index.values, dataset.reflectance.values
    step = np.diff(value, axis=1) / value[:, 1:]
    known = np.isfinite(step)
    changes = np.diff(index, axis=1) != 0
    across, within = (float(np.sqrt(np.mean(step[known & kind] ** 2))) for kind in (changes, ~changes))
    return across - within


def table(rows: Mapping[str, Figures]) -> str:
    """Markdown of the figures by the map that was planted."""
    lines = [
        "| planted map | gain | RMS, resolved | RMS, at the pixel | within 1, 2 sigma | seam | CPU s |",
        "| --- " * 7 + "|",
    ]
    for name, row in rows.items():
        percent = {key: 100 * value for key, value in row.items()}
        lines.append(
            f"| {name} | {row['gain']:.3f} | {percent['rms']:.2f} % | {percent['rms_at_pixel']:.1f} % "
            f"| {percent['within_1']:.0f}, {percent['within_2']:.0f} % | {percent['seam']:.2f} % | {row['cpu_s']:.0f} |"
        )
    return "\n".join(lines)


def other_europa(maps: Path | None) -> BaseMap | None:
    """The map of Europa that no correction uses, where the real mission files have it."""
    from catalog.basemap import read_map

    path = None if maps is None else maps / "europa_4096_left180E.jpg"
    return read_map(path, 180.0) if path is not None and path.is_file() else None
