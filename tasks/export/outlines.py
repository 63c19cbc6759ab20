"""Outlines of regions: polygons with holes in latitude and longitude, read from GeoJSON (RFC 7946).

Edges are straight in latitude and longitude, as GeoJSON has them. Of two neighbouring positions whose longitudes differ
by more than 180 degrees the shorter way is meant (350 to 10 runs through 0), but by exactly 360 the whole circle. A
ring that runs once round the body encloses the pole of its side.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.plain_files import read_json_file
from catalog.plain_text import printable
from catalog.reasons import Reason

Array = NDArray[np.float64]
POLYGONS = ("Polygon", "MultiPolygon")
REMEDY = "Give GeoJSON with a Feature for each region: a Polygon or MultiPolygon of [longitude, latitude] in degrees."
LONGITUDES = (-360.0, 720.0)  # that may be meant; anything else is metres or another mistake
LEAST_AREA = 1e-9  # square degrees


@dataclass(frozen=True)
class Outline:
    """polygons: each the rings (n, 2) of longitude (east, unwrapped) and latitude, closed; the first is the outside,
    the others are holes."""

    polygons: tuple[tuple[Array, ...], ...]

    def contains(self, latitude_deg: Array, longitude_deg: Array) -> NDArray[np.bool_]:
        """Which places (...) are inside of a polygon and outside of its holes; NaN is outside."""
        latitude, longitude = np.broadcast_arrays(latitude_deg, longitude_deg)
        inside = np.zeros(latitude.shape, bool)
        for outside, *holes in self.polygons:
            found = _inside(outside, latitude, longitude)
            for hole in holes:
                found &= ~_inside(hole, latitude, longitude)
            inside |= found
        return inside

    def box_deg(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Limits of latitude (south, north) and of longitude (west, east; 0, 360 for several polygons, or one that is
        wider than half the body)."""
        latitude = np.concatenate([rings[0][:, 1] for rings in self.polygons])
        west, east = self.polygons[0][0][:, 0].min(), self.polygons[0][0][:, 0].max()
        whole = len(self.polygons) > 1 or east - west > 180
        longitude = (0.0, 360.0) if whole else (float(west % 360), float(east % 360))
        return (float(latitude.min()), float(latitude.max())), longitude

    def as_geojson(self) -> dict[str, Any]:
        """A MultiPolygon in east longitudes."""
        return {"type": "MultiPolygon", "coordinates": [[ring.tolist() for ring in rings] for rings in self.polygons]}


def _inside(ring: Array, latitude: Array, longitude: Array) -> NDArray[np.bool_]:
    """Places inside of a ring, by the number of edges west of them (even-odd rule)."""
    west, east = ring[:, 0].min(), ring[:, 0].max()
    found = np.zeros(latitude.shape, bool)
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero((latitude >= ring[:, 1].min()) & (latitude <= ring[:, 1].max()) & np.isfinite(longitude))
    y = latitude.flat[near]
    first = west + np.mod(longitude.flat[near] - west, 360.0)
    for turn in range(int((east - west) // 360) + 1):
        x = first + 360.0 * turn
        odd = np.zeros(len(near), bool)
        for (x0, y0), (x1, y1) in pairwise(ring):
            if y0 != y1:
                crosses = (y0 <= y) != (y1 <= y)
                odd ^= crosses & (np.sign(y1 - y0) * ((x - x0) * (y1 - y0) - (y - y0) * (x1 - x0)) >= 0)
        found.flat[near] |= odd
    return found


def read_outlines(path: Path, west_longitudes: bool = False) -> list[tuple[str, Outline]]:
    """Names and outlines of the features of a GeoJSON file (FeatureCollection, Feature or bare geometry). The name is
    the property `region` or `name`, the `id`, or the feature's number. west_longitudes: they are positive westward.
    Raises RefusedError, with the feature and what is wrong with it, for anything else."""
    try:
        content = read_json_file(path)
        found = [(name, Outline(tuple(_polygons(each, west_longitudes)))) for name, each in _geometries(content)]
    except (OSError, ValueError) as error:
        raise RefusedError(Reason.REGIONS_UNREADABLE, f"{path} lists no regions ({error}).", REMEDY) from error
    if not found:
        raise RefusedError(Reason.REGIONS_UNREADABLE, f"{path} lists no regions (it has no feature).", REMEDY)
    return found


def _geometries(content: Any) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Names and geometries, with the name in every error."""
    kind = content.get("type") if isinstance(content, dict) else None
    if kind == "FeatureCollection":
        features = content.get("features")
        if not isinstance(features, list):
            raise ValueError("its features are no list")
    elif kind == "Feature":
        features = [content]
    elif kind in POLYGONS:
        features = [{"type": "Feature", "geometry": content}]
    else:
        raise ValueError(f"it is no GeoJSON with polygons: its type is {printable(str(kind))}")
    for number, feature in enumerate(features, start=1):
        if not isinstance(feature, dict) or feature.get("type") != "Feature":
            raise ValueError(f"feature {number} is no Feature")
        properties = feature.get("properties") or {}
        named = properties if isinstance(properties, dict) else {}
        name = printable(str(named.get("region") or named.get("name") or feature.get("id") or number))
        geometry = feature.get("geometry")
        if not isinstance(geometry, dict) or geometry.get("type") not in POLYGONS:
            found = geometry.get("type") if isinstance(geometry, dict) else None
            raise ValueError(f"region {name} is no polygon but {printable(str(found))}")
        yield name, {**geometry, "name": name}


def _polygons(geometry: Mapping[str, Any], west_longitudes: bool) -> Iterator[tuple[Array, ...]]:
    name, given = geometry["name"], geometry.get("coordinates")
    polygons = [given] if geometry["type"] == "Polygon" else given
    if not isinstance(polygons, list) or not polygons:
        raise ValueError(f"region {name} has no coordinates")
    for rings in polygons:
        if not isinstance(rings, list) or not rings:
            raise ValueError(f"region {name} has a polygon without a ring")
        yield tuple(_ring(ring, str(name), west_longitudes) for ring in rings)


def _ring(given: Any, name: str, west_longitudes: bool) -> Array:
    """A ring with its longitudes unwrapped, led over the pole where it encloses one."""
    if not isinstance(given, list) or len(given) < 4:
        raise ValueError(f"region {name} has a ring of fewer than 4 positions")
    ring = np.array([_position(each, name) for each in given])
    if abs(ring[0, 1] - ring[-1, 1]) > 0 or (ring[0, 0] - ring[-1, 0]) % 360 != 0:
        raise ValueError(f"region {name} has a ring that does not end where it begins")
    if west_longitudes:
        ring[:, 0] *= -1
    step = np.diff(ring[:, 0])
    shorter = np.where(np.abs(step) == 360, step, (step + 180) % 360 - 180)
    # A step of exactly half the body keeps its direction.
    step = np.where(np.abs(step) <= 180, step, shorter)
    ring[1:, 0] = ring[0, 0] + np.cumsum(step)
    if abs(ring[-1, 0] - ring[0, 0]) > 180:
        pole = 90.0 if ring[:, 1].mean() >= 0 else -90.0
        ring = np.concatenate([ring, [[ring[-1, 0], pole], [ring[0, 0], pole], ring[0]]])
    if _area(ring) < LEAST_AREA:
        raise ValueError(f"region {name} has a ring without area")
    return ring


def _position(given: Any, name: str) -> tuple[float, float]:
    numbers = given[:2] if isinstance(given, list) else []
    if len(numbers) < 2 or any(isinstance(each, bool) or not isinstance(each, int | float) for each in numbers):
        raise ValueError(
            f"region {name} has a position that is not [longitude, latitude]: {printable(str(given))[:60]}"
        )
    longitude, latitude = (float(each) for each in numbers)
    if not LONGITUDES[0] <= longitude <= LONGITUDES[1] or abs(latitude) > 90:
        raise ValueError(f"region {name} has a position that is no longitude and latitude in degrees: {numbers}")
    return longitude, latitude


def _area(ring: Array) -> float:
    x, y = (ring - ring[0]).T
    return abs(float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))) / 2
