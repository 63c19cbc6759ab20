"""Where other bodies are in the image, each by its own disk or limb, and how far apart bodies are.

Separations are of places in one image: the camera's pointing drops out of them, and what is left of the trajectory's
error is what parallax makes of it.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import map_of_target, uniform_map
from catalog.camera import Camera
from catalog.errors import FailedError, PlanetposeError
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import known_target
from tasks.bodies.masks import alone
from tasks.bodies.placed import Body, bodies_of, in_frame
from tasks.fields import Content, Json
from tasks.joint.find_pose import find_pose_jointly
from tasks.joint.parameters import OFFSET
from tasks.joint.settings import JointSettings
from tasks.point.by_limb import as_target_of, by_limb
from tasks.simulate import Scene

Array = NDArray[np.float64]

JOINT = JointSettings(hold=("range", "roll"), second_start=False)
# Bodies of a larger radius are planets whose clouds are no map's.
CLOUDS_KM = 20_000.0


class MeasuredBody(Content):
    """One other body of the frame. predicted_px: its centre by the corrected pose and its place relative to the target;
    measured_px: by itself, None where that was not measured, and why_not; sigma_px: 1-sigma (2,) of that; by: disk or
    limb, see `place_of`. range_km, lit_px: distance and width of the sunlit part."""

    name: str
    naif_id: int
    range_km: float
    lit_px: float
    predicted_px: tuple[float, float]
    measured_px: tuple[float, float] | None = None
    sigma_px: tuple[float, float] | None = None
    by: str | None = None
    why_not: str | None = None


def measured_bodies(observation: Observation, pose: Pose, scene: Scene) -> tuple[MeasuredBody, ...]:
    """All other bodies that are in the frame at the corrected pose."""
    bodies = bodies_of(pose, scene.target) if pose.bodies else []
    return tuple(
        measured(observation, pose, scene, body) for body in bodies if body.place and in_frame(body, scene.camera)
    )


def measured(observation: Observation, pose: Pose, scene: Scene, body: Body) -> MeasuredBody:
    """One of them."""
    x, y = scene.camera.project(body.pose.target_in_camera_km)
    lit_px = body.radius_px(scene.camera) * (1 + float(np.cos(np.radians(body.pose.phase_deg))))
    found = MeasuredBody(
        name=body.target.name,
        naif_id=body.naif_id,
        range_km=body.pose.range_km,
        lit_px=lit_px,
        predicted_px=(float(x), float(y)),
    )
    least_px = scene.settings.others.least_lit_px
    if lit_px < least_px:
        return found.model_copy(update={"why_not": f"its sunlit part is {lit_px:.0f} px wide, {least_px:g} needed"})
    try:
        centre, covariance, by = place_of(observation, pose, scene, body)
    except PlanetposeError as error:
        return found.model_copy(update={"why_not": error.fault})
    except np.linalg.LinAlgError:
        return found.model_copy(update={"why_not": "too little of it is seen to tell its place"})
    relief_px = body.place.relief_km * scene.camera.focal_length_px / body.pose.range_km if body.place else 0.0
    sigma = np.sqrt(np.diag(covariance) + relief_px**2)
    return found.model_copy(
        update={"measured_px": tuple(map(float, centre)), "sigma_px": tuple(map(float, sigma)), "by": by}
    )


def place_of(observation: Observation, pose: Pose, scene: Scene, body: Body) -> tuple[Array, Array, str]:
    """Centre (2,), its covariance (2, 2), pixels, and by what another body was measured: `disk`, limb and markings
    together as the joint step does, its range relative to the target's held; `limb` alone where the disk is larger than
    the frame. Raises FailedError where it cannot be measured."""
    known = known_target(body.target.name)
    has_map = known is not None and known.basemap is not None and known.mean_radius_km < CLOUDS_KM
    of_body = Scene(
        scene.camera, body.target, map_of_target(known) if known and has_map else uniform_map(), scene.settings
    )
    own = as_target_of(pose, scene.target, body)
    centre, size = scene.camera.project(own.target_in_camera_km), np.array(scene.camera.size_px)
    if (centre < 0).any() or (centre > size - 1).any() or 2 * body.radius_px(scene.camera) > size.max():
        return *by_limb(observation, own, of_body), "limb"
    left = alone(observation, own, of_body, keep_behind=False)
    if not left.usable.any():
        raise FailedError(Reason.NO_USABLE_PIXELS, "nothing of it is in sight.", "")
    found = find_pose_jointly(left, own, own, "spice", of_body, JOINT)
    if found.evidence.get("doubt"):
        raise FailedError(Reason.JOINT_NOT_SETTLED, str(found.evidence["doubt"]).partition(". ")[0], "")
    covariance = np.asarray(found.evidence["covariance"])[OFFSET, OFFSET]
    return scene.camera.project(found.pose.target_in_camera_km), covariance, "disk"


def separations(
    bodies: tuple[MeasuredBody, ...], correction: Mapping[str, Any], camera: Camera, range_km: float
) -> list[Json]:
    """What a result states of the bodies: their places, and how far from the target each was measured (arcsec, and km
    at the farther one's distance), less what the metadata say, with 1-sigma errors. correction: `centre_px` and
    `uncertainty` of the target."""
    return [stated(body, correction, camera, range_km) for body in bodies]


def stated(body: MeasuredBody, correction: Mapping[str, Any], camera: Camera, range_km: float) -> Json:
    """One body's."""
    said: Json = body.model_dump(mode="json") | {"separation": None}
    if body.measured_px is None or body.sigma_px is None:
        return said
    said["offset_px"] = [m - p for m, p in zip(body.measured_px, body.predicted_px, strict=True)]
    centre, sigma = correction["centre_px"], (correction.get("uncertainty") or {}).get("centre_px")
    if centre is None:
        return said
    apart, predicted = (angle_arcsec(camera, centre, place) for place in (body.measured_px, body.predicted_px))
    scale = np.degrees(1 / camera.focal_length_px) * 3600
    along = np.array(body.measured_px) - np.array(centre)
    length = float(np.hypot(*along))
    unit = along / max(length, 1e-12)
    variance = (unit * body.sigma_px) @ (unit * body.sigma_px)
    error = None
    if sigma is not None:
        of_scale = camera.focal_length_sigma or 0.0
        error = float(scale * np.sqrt(variance + (unit * sigma) @ (unit * sigma) + (of_scale * length) ** 2))
    km = np.radians(1 / 3600) * max(range_km, body.range_km)
    said["separation"] = {
        "arcsec": apart,
        "sigma_arcsec": error,
        "o_minus_c_arcsec": apart - predicted,
        "km": apart * km,
        "sigma_km": None if error is None else error * km,
        "o_minus_c_km": (apart - predicted) * km,
    }
    return said


def angle_arcsec(camera: Camera, a_px: Any, b_px: Any) -> float:
    """Angle between the lines of sight of two pixels."""
    a, b = camera.ray(a_px), camera.ray(b_px)
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)) * 3600)
