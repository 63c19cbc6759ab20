"""A pose from the scalars that some labels give (Galileo): sub-points, distance, north azimuth, centre pixel."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.pose import PartialPose
from catalog.reasons import Reason
from catalog.target import Target

LIGHT_SPEED_KM_S = 299_792.458
NEEDED = (
    "distance_km",
    "sub_spacecraft_lat_deg",
    "sub_spacecraft_lon_deg",
    "sub_solar_lat_deg",
    "sub_solar_lon_deg",
    "north_azimuth_deg",
    "centre_x_px",
    "centre_y_px",
    "solar_distance_km",
)


def pose_from_label_geometry(geometry: Mapping[str, float], camera: Camera, target: Target, et: float) -> PartialPose:
    """The pose in which the camera sees the sub-spacecraft point at the label's centre pixel, north at its azimuth.

    geometry: `NEEDED` keys; planetocentric latitudes and *east* longitudes, degrees; north_azimuth_deg clockwise from
    the direction of growing x (3 o'clock), y down; pixels 0-based, taken as undistorted (the label's prediction is
    tens of pixels off, distortion one). et: mid-exposure, TDB seconds past J2000.
    The label fixes the camera relative to the body only; J2000 comes in by the target's rotation model one light time
    earlier. Without a model the body frame stands for J2000 (see `orientation_note`).

    Raises RefusedError when a value is missing or impossible, or the spacecraft stands over a pole.
    """
    values = _checked(geometry, target)
    to_spacecraft = unit_vector(values["sub_spacecraft_lat_deg"], values["sub_spacecraft_lon_deg"])
    to_sun = unit_vector(values["sub_solar_lat_deg"], values["sub_solar_lon_deg"])
    to_target = camera.ray([values["centre_x_px"], values["centre_y_px"]])
    camera_from_body = _camera_from_body(to_spacecraft, to_target, values["north_azimuth_deg"])
    body_from_j2000 = np.eye(3)
    if target.rotation is not None:
        body_from_j2000 = target.rotation.body_from_j2000(et - values["distance_km"] / LIGHT_SPEED_KM_S)
    return PartialPose(
        et=et,
        camera_from_j2000=camera_from_body @ body_from_j2000,
        target_from_spacecraft_km=-values["distance_km"] * (body_from_j2000.T @ to_spacecraft),
        sun_from_target_km=values["solar_distance_km"] * (body_from_j2000.T @ to_sun),
        body_from_j2000=body_from_j2000,
    )


def orientation_note(target: Target) -> str | None:
    """What a reader of such a pose must know: None, or that J2000 is only a name for the body frame in it."""
    if target.rotation is not None:
        return None
    return f"{target.name} has no rotation model: the pose's J2000 axes are the body-fixed ones"


def unit_vector(lat_deg: float, lon_deg: float) -> NDArray[np.float64]:
    """Body-fixed unit vector (3,) of a planetocentric latitude and east longitude."""
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    return np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])


def _checked(geometry: Mapping[str, float], target: Target) -> dict[str, float]:
    remedy = "Give --pose FILE, or kernels that cover the image."
    missing = [key for key in NEEDED if key not in geometry or not math.isfinite(geometry[key])]
    if missing:
        raise RefusedError(Reason.LABEL_GEOMETRY_INCOMPLETE, f"the label lacks {', '.join(missing)}.", remedy)
    values = {key: float(geometry[key]) for key in NEEDED}
    distance, latitudes = values["distance_km"], (values["sub_spacecraft_lat_deg"], values["sub_solar_lat_deg"])
    if distance <= min(target.radii_km) or values["solar_distance_km"] <= 0 or max(map(abs, latitudes)) > 90:
        fault = f"the label's geometry is impossible: distance {distance} km, latitudes {latitudes}."
        raise RefusedError(Reason.LABEL_GEOMETRY_IMPOSSIBLE, fault, remedy)
    if abs(values["sub_spacecraft_lat_deg"]) > 89.99:
        fault = "the spacecraft stands over a pole, where a north azimuth means nothing."
        raise RefusedError(Reason.LABEL_GEOMETRY_POLAR, fault, remedy)
    return values


def _camera_from_body(
    to_spacecraft: NDArray[np.float64], to_target: NDArray[np.float64], north_azimuth_deg: float
) -> NDArray[np.float64]:
    """Rotation (3, 3) from two pairs of directions.

    The body's direction to the spacecraft is minus the line of sight. North, seen from a camera at the origin, lies in
    the plane of the line of sight d and of a = (cos azimuth, sin azimuth, 0); that plane's picture is the straight line
    through the centre pixel along a, on the axis and off it.
    """
    azimuth = math.radians(north_azimuth_deg)
    along_azimuth = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    in_body = _triad(to_spacecraft, np.array([0.0, 0.0, 1.0]))
    in_camera = _triad(-to_target, along_azimuth)
    return in_camera @ in_body.T


def _triad(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right-handed axes as columns: `first`, the part of `second` across it, and their cross product."""
    across = second - (second @ first) * first
    across /= np.linalg.norm(across)
    return np.column_stack([first, across, np.cross(first, across)])
