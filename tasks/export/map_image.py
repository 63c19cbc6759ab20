"""An image on a map: for every pixel of the map, where on the body it is, where that is in the image, and how it is
lit and seen. Images are resampled once; angles are computed at the map's pixels, not resampled."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.export.map_grid import Array, Bounds, MapGrid, MapProjection, grid_of, map_projection
from tasks.export.map_places import PLACES, MapPlaces
from tasks.export.source import Source
from tasks.project.pixels import project_pixels
from tasks.project.points import latitude_longitude, pixels_of_points, surface_points, visible

ANGLES = ("incidence", "emission", "phase")
LAYERS = ("image", *ANGLES, *PLACES)
KERNELS = ("nearest", "bilinear", "cubic")
MAX_EMISSION_DEG = 85.0
PROBE = 400  # places across a projection's extent that tell how far the image reaches
ROWS_PER_BLOCK = 256
LARGEST_OVERSAMPLE = 8


@dataclass(frozen=True)
class MapImage:
    """layers: by name (LAYERS), float32 (rows, columns), NaN where the image does not show the place: it is hidden,
    beyond the emission limit, outside the frame, or (the image alone) its pixels are unusable. quality: bits of the
    nearest pixel."""

    grid: MapGrid
    layers: dict[str, NDArray[np.float32]]
    kernel: str
    max_emission_deg: float


def map_image(
    source: Source,
    projection: str = "equirectangular",
    resolution_km: float | None = None,
    central_longitude_deg: float | None = None,
    kernel: str = "bilinear",
    max_emission_deg: float = MAX_EMISSION_DEG,
) -> MapImage:
    """The product's image, angles, coordinates with their errors, and flags on a map. resolution_km: side of a pixel
    (default: that of the image below the spacecraft). Where a map is coarser than the image, several places per pixel
    are averaged.

    Raises RefusedError when the image shows nothing of the body, for an unknown projection or kernel, and when the map
    would be too large.
    """
    if kernel not in KERNELS:
        raise RefusedError(
            Reason.KERNEL_UNKNOWN, f"no resampling kernel {kernel!r}.", f"Known are {', '.join(KERNELS)}."
        )
    finest_km = finest_resolution_km(source)
    centre = latitude_longitude(source.pose.spacecraft_in_body_km)
    wanted = map_projection(
        projection,
        source.target,
        finest_km if resolution_km is None else resolution_km,
        (float(centre[0]), float(centre[1])),
        central_longitude_deg,
    )
    grid = grid_of(wanted, reach_of_image(source, wanted, max_emission_deg))
    oversample = min(max(math.ceil(wanted.step_m / 1e3 / finest_km - 0.25), 1), LARGEST_OVERSAMPLE)
    image, places = source.undistorted_image(), MapPlaces(source)
    layers = {name: np.full(grid.shape, np.nan, np.float32) for name in LAYERS}
    for rows in _blocks(grid.shape[0]):
        block = _block(source, image, places, grid, rows, oversample, kernel, max_emission_deg)
        for name, values in block.items():
            layers[name][rows] = values
    return MapImage(grid, layers, kernel, max_emission_deg)


def finest_resolution_km(source: Source) -> float:
    """Size of an undistorted pixel on the surface below the spacecraft."""
    spacecraft = source.pose.spacecraft_in_body_km
    above_km = float(np.linalg.norm(spacecraft) * (1 - 1 / np.linalg.norm(spacecraft / source.target.radii_km)))
    return above_km / source.camera.focal_length_px


def reach_of_image(source: Source, projection: MapProjection, max_emission_deg: float) -> Bounds:
    """(x0, y0, x1, y1) of what the image shows, metres. Raises RefusedError when it shows nothing."""
    x0, y0, x1, y1 = projection.extent_m
    x, y = np.linspace(x0, x1, PROBE), np.linspace(y0, y1, PROBE)
    latitude, longitude = projection.latitude_longitude(*np.meshgrid(x, y))
    seen = np.isfinite(seen_places(source, latitude, longitude, max_emission_deg)["emission"])
    if not seen.any():
        raise RefusedError(
            Reason.NOTHING_TO_MAP,
            f"{source.product} shows nothing of {source.target.name} on this {projection.name} map.",
            "Choose another projection or a larger emission limit.",
        )
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    low_x, high_x = x[max(columns[0] - 1, 0)], x[min(columns[-1] + 1, PROBE - 1)]
    low_y, high_y = y[max(rows[0] - 1, 0)], y[min(rows[-1] + 1, PROBE - 1)]
    return float(low_x), float(low_y), float(high_x), float(high_y)


def _blocks(rows: int) -> Iterator[slice]:
    for first in range(0, rows, ROWS_PER_BLOCK):
        yield slice(first, min(first + ROWS_PER_BLOCK, rows))


def _block(
    source: Source,
    image: NDArray[np.float32],
    places: MapPlaces,
    grid: MapGrid,
    rows: slice,
    oversample: int,
    kernel: str,
    limit: float,
) -> dict[str, NDArray[np.float32]]:
    """The layers of some rows."""
    latitude, longitude = grid.projection.latitude_longitude(*np.meshgrid(grid.x_m(), grid.y_m()[rows]))
    seen = seen_places(source, latitude, longitude, limit)
    if oversample == 1:
        values = _sampled(image, seen["x_px"], seen["y_px"], kernel)
    else:
        fine_rows = slice(rows.start * oversample, rows.stop * oversample)
        fine = np.meshgrid(grid.x_m(oversample), grid.y_m(oversample)[fine_rows])
        parts = seen_places(source, *grid.projection.latitude_longitude(*fine), limit)
        values = _mean_of_parts(_sampled(image, parts["x_px"], parts["y_px"], kernel), oversample)
        values[~np.isfinite(seen["emission"])] = np.nan
    others = {name: seen[name] for name in ANGLES} | places.layers(latitude, longitude, seen["x_px"], seen["y_px"])
    return {"image": values, **{name: layer.astype(np.float32) for name, layer in others.items()}}


def seen_places(source: Source, latitude_deg: Array, longitude_deg: Array, max_emission_deg: float) -> dict[str, Array]:
    """Pixel and angles of places on the body; NaN where the image does not show them."""
    pose, camera, target = source.pose, source.camera, source.target
    points = surface_points(target, latitude_deg, longitude_deg)
    nx, ny = camera.size_px
    with np.errstate(invalid="ignore"):
        xy = pixels_of_points(pose, camera, points)
        inside = ((xy >= -0.5) & (xy <= np.array([nx, ny]) - 0.5)).all(axis=-1)
        shown = visible(pose, target, points) & inside
        angles = project_pixels(pose, camera, target, np.where(shown[..., None], xy, np.nan), ANGLES)
        shown &= angles["emission"] <= max_emission_deg
    found: dict[str, Any] = {"x_px": xy[..., 0], "y_px": xy[..., 1], **angles}
    return {name: np.where(shown, values, np.nan) for name, values in found.items()}


def _sampled(image: NDArray[np.float32], x_px: Array, y_px: Array, kernel: str) -> NDArray[np.float32]:
    """The image at places; NaN where they are, and where the kernel touches a pixel that is."""
    import cv2

    interpolation = {"nearest": cv2.INTER_NEAREST, "bilinear": cv2.INTER_LINEAR, "cubic": cv2.INTER_CUBIC}[kernel]
    known = np.isfinite(x_px)
    x, y = (np.where(known, places, 0.0).astype(np.float32) for places in (x_px, y_px))
    values = cv2.remap(image, x, y, interpolation, borderMode=cv2.BORDER_REPLICATE)
    return np.where(known, values, np.float32(np.nan)).astype(np.float32)


def _mean_of_parts(values: NDArray[np.float32], parts: int) -> NDArray[np.float32]:
    """Mean of the known values of each parts x parts square; NaN where fewer than half are known."""
    rows, columns = values.shape[0] // parts, values.shape[1] // parts
    squares = values.reshape(rows, parts, columns, parts)
    known = np.isfinite(squares)
    count = known.sum(axis=(1, 3))
    total = np.where(known, squares, 0.0).sum(axis=(1, 3), dtype=np.float64)
    return np.where(count * 2 >= parts * parts, total / np.maximum(count, 1), np.nan).astype(np.float32)
