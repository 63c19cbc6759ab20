"""One image as a mosaic takes it: brightness above the sky, its errors, and where places of the ground are in it."""

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.plain_text import printable
from catalog.pose import Pose
from catalog.target import Target
from tasks.export.source import Source, read_source
from tasks.joint.parameters import NAMES, State
from tasks.photometry.errors import brightness_errors, gradient
from tasks.photometry.region import refuse_empty, sky_level
from tasks.project.points import body_points, pixels_of_points, surface_points
from tasks.project.sight import sight_of
from tasks.project.uncertainty import PARAMETERS, PoseUncertainty

Array = NDArray[np.float64]
Image = NDArray[np.float32]
VIEWS_IN_MEMORY = 64
MARGIN_PX = 3
COVERAGE_SHAPE = (90, 180)  # cells of 2 degrees
PROBES = 15
STEPS = np.array([0.05, 0.05, 1e-5, 1e-3, 1e-3, 1e-3, 1e-3])  # small against what a pixel sees, in PARAMETERS' units


@dataclass(frozen=True)
class View:
    """image float32 (ny, nx): brightness above the sky in a window of the undistorted frame whose first pixel is
    `corner_px` (x, y), 0 where `usable` is false; steep: its gradient per pixel. noise: 1-sigma of a pixel. still_px,
    turning_px: 1-sigma of the place of the ground in the image, everywhere and (times the cosine of emission) by the
    body's orientation. basemap: name of the map that it was corrected with. coverage: see `_coverage`."""

    product: str
    image: Image
    steep: Image
    usable: NDArray[np.bool_]
    corner_px: tuple[int, int]
    noise: float
    still_px: float
    turning_px: float
    pose: Pose
    camera: Camera
    target: Target
    filter: str
    basemap: str
    coverage: NDArray[np.bool_]


@dataclass(frozen=True)
class Ground:
    """Places on the body: points (..., 3) km, body-fixed, and unit normals (..., 3)."""

    points: Array
    normals: Array


@dataclass(frozen=True)
class Seen:
    """How the ground (...) is seen: pixel x, y of the undistorted frame (..., 2), cosines of incidence and emission,
    phase in degrees, size of a pixel on the ground (its longer side) in km."""

    xy_px: Array
    mu0: Array
    mu: Array
    phase_deg: Array
    resolution_km: Array


def ground_at(target: Target, latitude_deg: Array, longitude_deg: Array) -> Ground:
    """The ground at planetocentric places (...); NaN where they are NaN."""
    points = surface_points(target, latitude_deg, longitude_deg)
    normals = points / np.asarray(target.radii_km) ** 2
    return Ground(points, normals / np.linalg.norm(normals, axis=-1, keepdims=True))


def seen_from(pose: Pose, camera: Camera, ground: Ground) -> Seen:
    """How a pose sees ground, hidden ground too (where a cosine is not positive)."""
    to_camera = sight_of(pose).spacecraft_km - ground.points
    distance = np.linalg.norm(to_camera, axis=-1)
    to_camera = to_camera / distance[..., None]
    to_sun = pose.body_from_j2000 @ pose.sun_from_target_km - ground.points
    to_sun = to_sun / np.linalg.norm(to_sun, axis=-1, keepdims=True)
    mu0, mu = (np.einsum("...k,...k", ground.normals, way) for way in (to_sun, to_camera))
    cosine = np.clip(np.einsum("...k,...k", to_sun, to_camera), -1, 1)
    resolution = distance / camera.focal_length_px / np.maximum(mu, 0.01)
    return Seen(pixels_of_points(pose, camera, ground.points), mu0, mu, np.degrees(np.arccos(cosine)), resolution)


@lru_cache(maxsize=VIEWS_IN_MEMORY)
def load_view(folder: Path) -> View:
    """The view of a product's folder; the last few are kept. Raises RefusedError when it cannot be read."""
    return view_of(read_source(folder))


def view_of(source: Source) -> View:
    """The view of a product. Raises RefusedError where its cube has no value of the image or of latitudes."""
    refuse_empty(source)
    raw = source.undistorted_image()
    inside = _on_body(source, raw.shape)
    usable = np.isfinite(raw) & inside
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    if not len(rows):
        rows, columns = np.array([0]), np.array([0])
    y0, x0 = max(rows[0] - MARGIN_PX, 0), max(columns[0] - MARGIN_PX, 0)
    window = slice(y0, rows[-1] + 1 + MARGIN_PX), slice(x0, columns[-1] + 1 + MARGIN_PX)
    sky = sky_level(source)
    level = np.where(np.isfinite(raw), raw - np.float32(sky), 0).astype(np.float32)
    known = np.isfinite(raw)
    errors = brightness_errors(source)
    still, turning = _place_sigmas(source)
    provenance: dict[str, Any] = json.loads(source.attributes["provenance"])
    return View(
        product=source.product,
        image=level[window].copy(),  # the whole frames would stay in memory behind their windows
        steep=gradient(level, known)[window].copy(),
        usable=(known & _near(usable))[window].copy(),
        corner_px=(int(x0), int(y0)),
        noise=float(np.median(errors.noise)),
        still_px=still,
        turning_px=turning,
        pose=source.pose,
        camera=source.camera,
        target=source.target,
        filter=str((provenance.get("image") or {}).get("filter") or "unknown"),
        basemap=str((provenance.get("basemap") or {}).get("name") or "unknown"),
        coverage=_coverage(source),
    )


def mixture_notes(views: Iterable[tuple[str, str]], filters_apart: bool = False) -> list[str]:
    """Sentences for images of several filters (unless each has a map of its own) or that were corrected with several
    base maps. views: filter and base map of each."""
    filters, maps = (Counter(each) for each in zip(*views, strict=True))
    found = []
    if len(filters) > 1 and not filters_apart:
        found.append(f"several filters ({_counted(filters)}): their ground and law are taken to be the same")
    if len(maps) > 1:
        found.append(f"corrected with several base maps ({_counted(maps)}): orientations differ by what these maps do")
    return found


def _counted(found: Counter[str]) -> str:
    return ", ".join(f"{printable(name)} {times}" for name, times in sorted(found.items()))


def _near(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    import cv2

    return cv2.dilate(mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0


def _on_body(source: Source, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Pixels (ny, nx) of the undistorted frame that see the body."""
    y, x = np.indices(shape)
    places = np.stack([x, y], axis=-1).astype(np.float64)
    return np.isfinite(body_points(source.pose, source.camera, source.target, places)[..., 0])


def _place_sigmas(source: Source) -> tuple[float, float]:
    """1-sigma in pixels of where the ground is in the image: the median over the disk of what pointing, range and roll
    do, and of what the body's orientation does to ground seen from above."""
    uncertainty = json.loads(source.attributes["uncertainty"])
    covariance = PoseUncertainty.from_dict(uncertainty).covariance if "covariance" in uncertainty else np.zeros((7, 7))
    spacecraft = source.pose.spacecraft_in_body_km
    up = spacecraft / np.linalg.norm(spacecraft)
    side = np.cross(up, [0.3, 0.5, 0.81])
    side /= np.linalg.norm(side)
    around = np.linspace(0, 2 * np.pi, PROBES, endpoint=False)[:, None]
    way = up + 0.8 * (np.cos(around) * side + np.sin(around) * np.cross(up, side))
    points = way / np.linalg.norm(way / np.asarray(source.target.radii_km), axis=-1, keepdims=True)
    moves = place_derivatives(source.pose, source.camera, points)
    still, turning = moves[:, :4], moves[:, 4:]
    of_pose = np.einsum("nkx,kl,nlx->n", still, covariance[:4, :4], still) / 2
    of_body = np.einsum("nkx,kl,nlx->n", turning, covariance[4:, 4:], turning) / 2
    return float(np.sqrt(np.median(of_pose))), float(np.sqrt(np.median(of_body)) / 0.78)


def place_derivatives(pose: Pose, camera: Camera, points_km: Array) -> Array:
    """Derivatives (n, 7, 2) of the pixels of body-fixed points (n, 3) by the unknowns of a pose, in the units of
    `tasks.project.uncertainty.PARAMETERS` (central differences)."""
    found = np.empty((len(points_km), len(PARAMETERS), 2))
    state = State(pose, 1.0)
    for k, step in enumerate(STEPS):
        ends = []
        for sign in (1, -1):
            change = np.zeros(len(NAMES))
            change[k] = sign * step
            ends.append(pixels_of_points(state.moved(change, camera).pose, camera, points_km))
        found[:, k] = (ends[0] - ends[1]) / (2 * step)
    return found


def _coverage(source: Source) -> NDArray[np.bool_]:
    """Which cells (90, 180) of 2 degrees, from the north pole and longitude 0, the image may show."""
    import cv2

    rows, columns = COVERAGE_SHAPE
    latitude = 90 - (np.arange(rows) + 0.5) * 180 / rows
    longitude = (np.arange(columns) + 0.5) * 360 / columns
    seen = seen_from(source.pose, source.camera, ground_at(source.target, latitude[:, None], longitude[None, :]))
    nx, ny = source.camera.size_px
    with np.errstate(invalid="ignore"):
        inside = (seen.xy_px > -1).all(axis=-1) & (seen.xy_px < np.array([nx, ny])).all(axis=-1) & (seen.mu > -0.05)
    shown = inside.astype(np.uint8)
    cube = source.cube
    y, x = np.nonzero(np.isfinite(cube["latitude"].values))
    part = slice(None, None, max(1, len(y) // 20_000))
    row = np.clip((90 - cube["latitude"].values[y, x][part]) * rows / 180, 0, rows - 1).astype(int)
    shown[row, np.clip(cube["longitude"].values[y, x][part] * columns / 360, 0, columns - 1).astype(int)] = 1
    wide = cv2.dilate(np.pad(shown, ((0, 0), (2, 2)), mode="wrap"), np.ones((3, 3), np.uint8))[:, 2:-2] > 0
    for edge in (slice(0, 3), slice(-3, None)):  # cells are narrow there
        wide[edge] |= wide[edge].any(axis=1, keepdims=True)
    return np.asarray(wide)
