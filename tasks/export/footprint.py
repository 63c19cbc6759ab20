"""Where on the body an image looks, as GeoJSON, and how it looks there: what catalogs of images ask for."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.export.map_image import MAX_EMISSION_DEG, seen_places
from tasks.export.source import Source
from tasks.project.points import surface_points

STEP_DEG = 1.0
# Latitudes from the north and longitudes from -180 of the cells that footprints are made of, degrees.
CELL_CENTRES = (
    90 - STEP_DEG * (np.arange(round(180 / STEP_DEG)) + 0.5),
    -180 + STEP_DEG * (np.arange(round(360 / STEP_DEG)) + 0.5),
)


@dataclass(frozen=True)
class View:
    """At the place that the image sees most from above: latitude, longitude (east), incidence, emission, degrees; the
    azimuths of Sun and spacecraft, clockwise from north; off_nadir: angle at the spacecraft between that place and the
    body's centre."""

    latitude_deg: float
    longitude_deg: float
    incidence_deg: float
    emission_deg: float
    sun_azimuth_deg: float
    spacecraft_azimuth_deg: float
    off_nadir_deg: float


def footprint(source: Source) -> tuple[dict[str, Any], list[float], View]:
    """GeoJSON MultiPolygon, its box (west, south, east, north), and the view. Longitudes run from -180 to 180, east
    positive; the outline follows whole degrees, so poles and the antimeridian need no care. Raises RefusedError when
    the image shows nothing of the body."""
    latitude, longitude = CELL_CENTRES
    longitudes, latitudes = np.meshgrid(longitude, latitude)
    seen = seen_places(source, latitudes, longitudes, MAX_EMISSION_DEG)
    mask = np.isfinite(seen["emission"])
    if not mask.any():
        raise RefusedError(
            Reason.NOTHING_TO_MAP,
            f"{source.product} shows nothing of {source.target.name}.",
            "`planetpose show` draws what it shows.",
        )
    geometry, box = geometry_of(mask)
    row, column = np.unravel_index(np.nanargmin(np.where(mask, seen["emission"], np.nan)), mask.shape)
    return geometry, box, view_at(source, float(latitude[row]), float(longitude[column]), seen, (int(row), int(column)))


def geometry_of(mask: NDArray[np.bool_]) -> tuple[dict[str, Any], list[float]]:
    """GeoJSON MultiPolygon of the marked cells (CELL_CENTRES), and its box (west, south, east, north)."""
    from affine import Affine
    from rasterio.features import shapes

    transform = Affine(STEP_DEG, 0, -180, 0, -STEP_DEG, 90)
    found = [shape for shape, value in shapes(mask.astype(np.uint8), mask=mask, transform=transform) if value]
    corners = np.concatenate([np.asarray(ring) for shape in found for ring in shape["coordinates"]])
    box = [float(value) for value in (*corners.min(axis=0), *corners.max(axis=0))]
    return {"type": "MultiPolygon", "coordinates": [_lists(shape["coordinates"]) for shape in found]}, box


def view_at(
    source: Source, latitude_deg: float, longitude_deg: float, seen: dict[str, Any], place: tuple[int, int]
) -> View:
    """The view of one place, whose angles are in `seen` at `place`."""
    pose = source.pose
    point = surface_points(source.target, latitude_deg, longitude_deg)
    spacecraft, sun = pose.spacecraft_in_body_km, pose.body_from_j2000 @ pose.sun_from_target_km
    down, inward = point - spacecraft, -spacecraft
    cosine = down @ inward / np.linalg.norm(down) / np.linalg.norm(inward)
    return View(
        latitude_deg,
        longitude_deg % 360,
        float(seen["incidence"][place]),
        float(seen["emission"][place]),
        azimuth_deg(source, point, sun),
        azimuth_deg(source, point, spacecraft),
        float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))),
    )


def azimuth_deg(source: Source, point_km: NDArray[np.float64], toward_km: NDArray[np.float64]) -> float:
    """Direction of something seen from a surface point, clockwise from north, 0-360."""
    up = point_km / np.square(source.target.radii_km)
    up = up / np.linalg.norm(up)
    east = np.cross([0.0, 0.0, 1.0], up)
    north = np.cross(up, east)
    direction = toward_km - point_km
    return float(np.degrees(np.arctan2(direction @ east, direction @ north)) % 360.0)


def _lists(rings: Any) -> list[list[list[float]]]:
    return [[[float(x), float(y)] for x, y in ring] for ring in rings]
