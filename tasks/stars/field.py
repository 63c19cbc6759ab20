"""The stars of one frame: detected in the frame's own pixels, their distortion taken out, identified, and the camera's
orientation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.observation import Observation, Quality
from catalog.reasons import Reason
from catalog.stars.observer import Observer
from catalog.stars.source import StarCatalog
from tasks.stars.match import Measured, mutual
from tasks.stars.settings import StarSettings
from tasks.stars.solve import Lock, Region, solve
from tasks.stars.sources import POINT, STAR, UNFIT, Sources, find_sources
from tasks.undistort import UndistortSettings, undistort
from tasks.undistort.model import DistortionModel

Array = NDArray[np.float64]
UNDERSAMPLED_PX = 0.55  # star images narrower than this look like single pixels


@dataclass(frozen=True)
class StarField:
    """What was found in a frame. sources: in the frame's own pixels, `strong` of which stand out, the first ones.
    xy_px: (n, 2), their undistorted places. sigma_px: (n,), of one coordinate. lock: None where no orientation was
    found, and `reason` says why, as `code: fault`. false_alarm: of the lock, or the least that was reached. faint:
    fainter peaks where the orientation has a star, and the stars, see `faint_matches`."""

    sources: Sources
    xy_px: Array
    sigma_px: Array
    model: DistortionModel
    catalog: str
    lock: Lock | None
    false_alarm: float
    reason: str | None
    strong: int
    faint: tuple[NDArray[np.int_], NDArray[np.int_]] | None = None


def find_stars(
    observation: Observation,
    camera: Camera,
    catalog: StarCatalog,
    observer: Observer,
    regions: Sequence[Region],
    settings: StarSettings,
    undistorting: UndistortSettings,
    undistorted: bool = False,
) -> StarField:
    """Stars of a frame as its file has it. regions: where the camera may look, in the order of trying. undistorted: the
    frame is in the camera's undistorted geometry already. Raises RefusedError as `undistort`, and where the catalog
    cannot be read."""
    sensor = undistort(observation, camera, undistorting.model_copy(update={"space": "sensor"}), undistorted)
    scale = pixel_scale(sensor.model)
    detection = settings.detection
    low = detection.model_copy(update={"least_signal_to_noise": detection.faintest_signal_to_noise})
    sources = find_sources(sensor.observation, camera.psf_sigma_px / scale, low)
    xy = sensor.model.undistort_points(sources.xy_px)
    known = np.isfinite(xy).all(axis=1) & (sources.kind != UNFIT)
    sources, xy = sources.only(known), xy[known]
    own = np.sqrt(np.trace(sources.covariance_px2, axis1=1, axis2=2) / 2) * scale
    sigma = np.hypot(own, sensor.model.uncertainty_px(xy)) if len(xy) else own
    narrow = float(np.sqrt(np.trace(sources.shape_px2) / 2)) < UNDERSAMPLED_PX
    sure = (sources.kind == STAR) | ((sources.kind == POINT) & narrow)
    # Sorted by signal to noise: the first ones are those that stand out.
    strong = int((sources.signal_to_noise >= detection.least_signal_to_noise).sum())
    seen = Measured(xy, sigma, sources.height)
    lock, false_alarm = solve(
        camera,
        seen.only(slice(strong)),
        sure[:strong],
        regions,
        catalog.stars,
        observer.apparent,
        settings.identification,
    )
    faint = None if lock is None else faint_matches(camera, lock, seen, strong)
    why = None if lock else _why(int(sure[:strong].sum()), saturated_spots(observation), false_alarm, settings)
    return StarField(sources, xy, sigma, sensor.model, catalog.name, lock, false_alarm, why, strong, faint)


def faint_matches(camera: Camera, lock: Lock, seen: Measured, strong: int) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Fainter peaks, from number `strong` on, that lie where the orientation has catalog stars not found yet; their
    numbers and the stars' (m,). They take no part in the orientation."""
    turned, matched = lock.matched.orientation.camera_from_j2000, lock.matched
    rest = np.setdiff1d(np.arange(len(lock.directions)), matched.star)
    faint = np.arange(strong, len(seen.xy_px))
    if not len(faint) or not len(rest):
        return np.zeros(0, int), np.zeros(0, int)
    detection, star = mutual(camera, turned, lock.directions[rest], seen.xy_px[faint], matched.radius_px)
    return faint[detection], rest[star]


def pixel_scale(model: DistortionModel) -> float:
    """Undistorted pixels per raw one at the frame's middle."""
    middle = (np.array(model.raw_size_px, dtype=np.float64) - 1) / 2
    corners = model.undistort_points(middle + np.array([[-20.0, 0.0], [20.0, 0.0], [0.0, -20.0], [0.0, 20.0]]))
    lengths = np.linalg.norm(corners[[1, 3]] - corners[[0, 2]], axis=1) / 40.0
    return float(np.sqrt(np.prod(lengths))) if np.isfinite(lengths).all() else 1.0


def saturated_spots(observation: Observation) -> int:
    """How many groups of saturated pixels a frame has."""
    import cv2

    saturated = (observation.quality & np.uint16(Quality.SATURATED)) != 0
    return int(cv2.connectedComponents(saturated.astype(np.uint8))[0]) - 1 if saturated.any() else 0


def _why(stars: int, saturated: int, false_alarm: float, settings: StarSettings) -> str:
    least = settings.identification.least_stars
    if stars < least:
        spots = f" {saturated} saturated spots are not measured: a shorter exposure may serve." if saturated else ""
        return f"{Reason.STARS_TOO_FEW}: {stars} star images stand out, {least} are needed.{spots}"
    bar = settings.identification.largest_false_alarm
    return (
        f"{Reason.STARS_NOT_IDENTIFIED}: of {stars} star images no group agrees with the catalog better than chance: "
        f"the best would with probability {false_alarm:.1g}, {bar:.0e} is the limit."
    )
