"""The pose of a frame of which camera and target are known and no geometry at all, with how well each part is known."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import uniform_map
from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.spice_pose import LIGHT_KM_PER_S
from catalog.target import Target
from tasks.attitude.solve import AttitudeSettings, find_attitude
from tasks.initial_pose.limb import Limb
from tasks.initial_pose.map_search import MapSearch, search_map
from tasks.initial_pose.outline import Found, find_outline
from tasks.initial_pose.settings import ImagePoseSettings, LimbSearchSettings
from tasks.initial_pose.time_known import known_by_time, radius_by_time, sun_apart_deg
from tasks.priors import PriorSettings
from tasks.simulate import Scene
from tasks.simulate.suns import with_sun, with_sun_moved
from tasks.simulate.window import disk_radius_px
from tasks.validate.sun import SunReport, solved_with_sun

Array = NDArray[np.float64]

# Where the Sun's distance is not known, only its direction counts: so many times the target's range, and at least
# the Sun's distance of Mercury.
SUN_TIMES_RANGE, LEAST_SUN_KM = 100.0, 5e7
# RMS about each axis of an orientation of which nothing is known: of all rotations alike.
UNKNOWN_DEG = 76.0
ROUNDS = 2
# So far a disk's shading changes in proportion to a turn of the Sun, the terminator's own place not counted.
LINEAR_SUN_DEG = 5.0
# What a trajectory's kernels are known to.
TRAJECTORY = PriorSettings()


@dataclass(frozen=True)
class ImagePose:
    """pose: found in the image. has_orientation: whether its sub-spacecraft point and north are the image's; else they
    are arbitrary. range_sigma: relative; centre_sigma_px: (2,); sun_sigma_deg: of the Sun's direction; 1-sigma all.
    priors: of the corrections that start there, the orientation's its error about each axis. evidence: plain JSON
    values. doubts: what stays unknown, each as `code: fault. Remedy.`"""

    pose: Pose
    has_orientation: bool
    range_sigma: float
    centre_sigma_px: tuple[float, float]
    sun_sigma_deg: float
    priors: PriorSettings
    evidence: dict[str, Any] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()

    def sigmas(self) -> dict[str, Any]:
        """1-sigma of every part, as plain JSON values."""
        return {
            "centre_px": list(self.centre_sigma_px),
            "range_relative": self.range_sigma,
            "sun_deg": self.sun_sigma_deg,
            "attitude_deg": self.priors.attitude_deg,
        }


def find_pose(
    observation: Observation,
    scene: Scene,
    et: float | None,
    settings: ImagePoseSettings,
    kernels: Iterable[Path] = (),
) -> ImagePose:
    """The pose by the image alone: centre and range by the limb and the target's radii, the Sun's direction by
    terminator and shading, the orientation by the base map's markings where they single one out.

    observation: undistorted. et: of mid-exposure, None where unknown. The target's own rotation model, where it has one
    and the time is known, says how J2000 lies; else the body-fixed frame is taken for it. Where the orientation is
    found and the time known, the Sun is where it was at that time, and the image's is the test of both. kernels: what
    of them covers the time is used (see `known_by_time`). Raises RefusedError `no-limb` or `limb-too-short`.
    """
    camera, target = scene.camera, scene.target
    kernels = tuple(kernels)
    found = outline_in(observation, scene, et, settings.limb, kernels)
    limb, sun = found.outline.limb, found.outline.sun
    pose = with_sun(pose_of_limb(limb, camera, target, et), sun.azimuth_deg, sun.phase_deg)
    has_map = bool(np.ptp(scene.basemap.albedo) > 0)
    search = MapSearch(None)
    report = SunReport()
    for _ in range(ROUNDS):
        pose, report = refined(
            observation, pose, scene if search.turn is not None else unmapped(scene), limb, settings.same_sigmas
        )
        if not has_map:
            break
        again = search_map(observation, pose, scene, settings.map, search.followed)
        search = replace(again, tried=search.tried + again.tried)
        if search.turn is None or search.followed is None:
            break
        pose = turned(pose, search.turn)
        # Turns of the new start: a better Sun moves none of them far.
        search = replace(search, followed=search.turn.T @ search.followed)
    known = search.turn is not None
    if known:
        pose = aligned(observation, pose, scene, settings.map.sigma_deg)
    by_shading = report.phase_sigma_deg or float(np.hypot(sun.phase_sigma_deg, settings.rough_sun_deg))
    sun_sigma = float(np.hypot(by_shading, settings.sun_sigma_deg))
    by_time = known_by_time(pose, scene, et, kernels)
    in_j2000 = known and et is not None and target.rotation is not None
    of_limb, apart_deg = range_sigma(limb, camera, target), None
    priors = PriorSettings(
        range_km=None,
        range_share=max(settings.range_prior_times * of_limb, settings.range_prior_share),
        attitude_deg=settings.map.sigma_deg if known else UNKNOWN_DEG,
    )
    if by_time.range_km is not None and abs(by_time.range_km / pose.range_km - 1) < settings.same_sigmas * of_limb:
        pose = pose.with_range_factor(by_time.range_km / pose.range_km)
        priors = priors.model_copy(update={"range_km": TRAJECTORY.range_km, "range_share": None})
    if in_j2000 and by_time.sun_from_target_km is not None:
        apart_deg = sun_apart_deg(pose, by_time.sun_from_target_km)
    contradicts = apart_deg is not None and apart_deg >= settings.same_sigmas * sun_sigma
    if apart_deg is not None and by_time.sun_from_target_km is not None and not contradicts:
        pose = pose.replaced(sun_from_target_km=by_time.sun_from_target_km)
        sun_sigma = settings.time_sun_sigma_deg
    priors = priors.model_copy(update={"sun_deg": min(sun_sigma, LINEAR_SUN_DEG)})
    found_by = evidence_of_parts(found, pose, scene, search, report, et)
    found_by |= {"time": by_time.source, "sun_by_time_apart_deg": apart_deg}
    doubts = doubts_of(found, has_map, search, et)
    if apart_deg is not None and contradicts:
        doubts = (*doubts, sun_contradicts_time(apart_deg, sun_sigma))
    return ImagePose(
        pose=pose,
        has_orientation=known,
        range_sigma=of_limb if priors.range_share else priors.range_sigma(pose.range_km),
        centre_sigma_px=(float(np.sqrt(limb.covariance[0, 0])), float(np.sqrt(limb.covariance[1, 1]))),
        sun_sigma_deg=sun_sigma,
        priors=priors,
        evidence=found_by,
        doubts=doubts,
    )


def outline_in(
    observation: Observation, scene: Scene, et: float | None, settings: LimbSearchSettings, kernels: tuple[Path, ...]
) -> Found:
    """The target's outline; where too little of a limb is seen to tell its radius and kernels give the range, by that
    radius. Raises RefusedError `no-limb` or `limb-too-short`."""
    try:
        return find_outline(observation, scene.target, settings)
    except RefusedError:
        radius_px = radius_by_time(scene, et, kernels) if kernels else None
        if radius_px is None:
            raise
    return find_outline(observation, scene.target, settings, radius_px)


def sun_contradicts_time(apart_deg: float, sigma_deg: float) -> str:
    """The doubt that the Sun in the image raises, where it is not the one of the time and the orientation found."""
    return (
        f"{Reason.SUN_CONTRADICTS_TIME}: with the orientation that the markings give, shading and terminator put the "
        f"Sun {apart_deg:.0f} deg (1-sigma {sigma_deg:.1f}) from where it was at the label's time. Check the time, the "
        "target, the base map and whether the picture is mirrored (--flip)."
    )


def pose_of_limb(limb: Limb, camera: Camera, target: Target, et: float | None) -> Pose:
    """Target at the limb's centre, as far away as its radii make it, its north up, longitude 0 towards the camera; the
    Sun behind the camera."""
    ray = camera.ray(limb.centre_px)
    largest = (target.radii_km[0] + target.radii_km[1]) / 2
    # Off axis a disk is stretched along the radius by the secant squared, across it by the secant.
    semi_px = limb.semi_px * float(ray[2]) ** 1.5
    range_km = largest * float(np.hypot(1.0, camera.focal_length_px / semi_px))
    time = 0.0 if et is None else et
    body = np.eye(3)
    if et is not None and target.rotation is not None:
        body = target.rotation.body_from_j2000(et - range_km / LIGHT_KM_PER_S)
    down = np.array([0.0, 1.0, 0.0]) - ray[1] * ray
    down /= np.linalg.norm(down)
    # Columns: where the body's axes point in the camera frame.
    camera_from_body = np.stack([-ray, np.cross(down, ray), -down], axis=1)
    camera_from_j2000 = camera_from_body @ body
    towards = camera_from_j2000.T @ ray
    return Pose(
        et=time,
        camera_from_j2000=camera_from_j2000,
        target_from_spacecraft_km=towards * range_km,
        sun_from_target_km=-towards * max(SUN_TIMES_RANGE * range_km, LEAST_SUN_KM),
        body_from_j2000=body,
    )


def turned(pose: Pose, turn: Array) -> Pose:
    """The pose with the body turned in the camera's frame and at rest in J2000: camera, target and Sun go about it."""
    camera_from_body = pose.camera_from_body @ turn
    camera_from_j2000 = camera_from_body @ pose.body_from_j2000
    about = camera_from_j2000.T @ pose.camera_from_j2000
    return pose.replaced(
        camera_from_j2000=camera_from_j2000,
        target_from_spacecraft_km=about @ pose.target_from_spacecraft_km,
        sun_from_target_km=about @ pose.sun_from_target_km,
    )


def aligned(observation: Observation, pose: Pose, scene: Scene, sigma_deg: float) -> Pose:
    """The pose with the orientation of optical flow between the markings of image and map: the Sun of a known time is
    as far off in the image as the orientation is. sigma_deg: 1-sigma of the orientation of `pose`."""
    found = find_attitude(observation, pose, scene, AttitudeSettings(), prior_deg=sigma_deg).pose
    return turned(pose, pose.camera_from_body.T @ found.camera_from_body)


def refined(
    observation: Observation, pose: Pose, scene: Scene, limb: Limb, same_sigmas: float
) -> tuple[Pose, SunReport]:
    """The pose with centre, range and Sun of least squares on the whole disk, which know how a limb is blurred and
    darkened; as it was where they do not come to rest, or end elsewhere than the limb allows."""
    report, solved = solved_with_sun(observation, pose, scene)
    moved = scene.camera.project(solved.target_in_camera_km) - limb.centre_px
    grown = np.log(solved.range_km / pose.range_km)
    sigma = np.sqrt(np.diag(limb.covariance))
    within = float(np.abs(moved / sigma[:2]).max()) < same_sigmas and abs(grown) < same_sigmas * sigma[2]
    if report.azimuth_deg is None or report.phase_deg is None or within:
        return solved, report
    return with_sun_moved(pose, report.azimuth_deg, report.phase_deg), report


def unmapped(scene: Scene) -> Scene:
    """The scene of a body without markings."""
    return replace(scene, basemap=uniform_map())


def range_sigma(limb: Limb, camera: Camera, target: Target) -> float:
    """1-sigma of the range, relative: of the limb's fit, of which of its axes is which radius, of radius and focal
    length."""
    a, b, c = sorted(target.radii_km, reverse=True)
    parts = [float(np.sqrt(limb.covariance[2, 2])), (a - b) / (a + b), camera.focal_length_sigma]
    if np.hypot(*limb.flattening) == 0:
        parts.append((a - c) / (a + c))
    parts.append((target.radius_sigma_km or 0.0) / target.mean_radius_km)
    return float(np.sqrt(np.sum(np.square(parts))))


def evidence_of_parts(
    found: Found, pose: Pose, scene: Scene, search: MapSearch, report: SunReport, et: float | None
) -> dict[str, Any]:
    """How each part was found, as plain JSON values."""
    limb = found.outline.limb
    return {
        "centre": "limb",
        "range": "limb and the target's radii",
        "sun": "terminator and shading",
        "orientation": "base map" if search.turn is not None else "unknown",
        "frame": "rotation model and time" if et is not None and scene.target.rotation else "body-fixed",
        "limb_arc_deg": limb.arc_deg,
        "limb_scatter_px": limb.residual_px,
        "flattening": float(np.hypot(*limb.flattening)),
        "diameter_px": float(2 * disk_radius_px(pose, scene.camera, scene.target)),
        "likeness": found.outline.sun.likeness,
        "phase_deg": pose.phase_deg,
        "phase_sigma_deg": report.phase_sigma_deg,
        "azimuth_sigma_deg": report.azimuth_sigma_deg,
        "map_search": search.to_dict(),
        "another_disk_px": None if found.rival is None else found.rival.limb.centre_px.tolist(),
    }


def doubts_of(found: Found, has_map: bool, search: MapSearch, et: float | None) -> tuple[str, ...]:
    """What the image leaves unknown, each as `code: fault. Remedy.`"""
    doubts = []
    if search.turn is None:
        why = "the target has no base map, so that nothing in the image tells its orientation"
        if has_map and search.sigmas is None:
            why = "the disk shows too little for its markings to be compared with the base map"
        elif has_map:
            why = (
                f"the base map's markings single out no orientation (the best by {search.sigmas:.1f} sigmas, the next "
                f"by {search.next_sigmas:.1f})"
            )
        doubts.append(
            f"{Reason.ORIENTATION_UNKNOWN}: {why}: latitudes, longitudes and north are arbitrary. Give a pose file "
            "with body_from_j2000 and camera_from_j2000, or kernels."
        )
    if found.rival is not None:
        x, y = found.rival.limb.centre_px
        doubts.append(
            f"{Reason.SEVERAL_DISKS}: another lit disk, at ({x:.0f}, {y:.0f}), may be the target as well. Mask it "
            "(--mask), or give a pose file."
        )
    if et is None:
        doubts.append(
            f"{Reason.TIME_UNKNOWN}: the label gives no time, and the image cannot: the pose's time is J2000's epoch. "
            "Give a pose file with utc, et or all of the geometry."
        )
    return tuple(doubts)
