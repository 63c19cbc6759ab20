"""Between pixels and points on the target's surface, both ways."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.rays import intersect, rays_of, spacecraft_in_radii, sun_in_radii
from tasks.project.sight import sight_of

Array = NDArray[np.float64]


def body_points(pose: Pose, camera: Camera, target: Target, xy_px: ArrayLike) -> Array:
    """Surface points (..., 3) km, body-fixed, seen at undistorted pixels (..., 2); NaN off the body.

    Raises RefusedError when the pose puts the spacecraft inside the target.
    """
    return intersect(rays_of(pose, camera, target), xy_px) * np.asarray(target.radii_km)


def pixels_of_points(pose: Pose, camera: Camera, points_km: ArrayLike) -> Array:
    """Undistorted pixels (..., 2) of body-fixed points (..., 3) km, hidden ones too; NaN behind the camera."""
    sight = sight_of(pose)
    from_spacecraft = np.asarray(points_km, dtype=np.float64) - sight.spacecraft_km
    return camera.project(from_spacecraft @ np.linalg.inv(sight.body_from_camera).T)


def surface_points(target: Target, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> Array:
    """Points (..., 3) km on the ellipsoid at planetocentric latitude and east longitude, degrees."""
    lat, lon = np.broadcast_arrays(np.radians(latitude_deg), np.radians(longitude_deg))
    direction = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
    return direction / np.linalg.norm(direction / np.asarray(target.radii_km), axis=-1, keepdims=True)


def latitude_longitude(points_km: ArrayLike) -> tuple[Array, Array]:
    """Planetocentric latitude and east longitude in [0, 360), degrees, of body-fixed points (..., 3)."""
    p = np.asarray(points_km, dtype=np.float64)
    latitude = np.degrees(np.arctan2(p[..., 2], np.hypot(p[..., 0], p[..., 1])))
    longitude = np.degrees(np.arctan2(p[..., 1], p[..., 0]))
    longitude = np.where(longitude < 0, longitude + 360.0, longitude)
    return latitude, np.where(longitude >= 360.0, 0.0, longitude)


def visible(pose: Pose, target: Target, points_km: ArrayLike) -> NDArray[np.bool_]:
    """Whether surface points (..., 3) km, body-fixed, face the spacecraft: (...)."""
    return np.asarray(points_km) / np.asarray(target.radii_km) @ spacecraft_in_radii(pose, target) > 1.0


def illuminated(pose: Pose, target: Target, points_km: ArrayLike) -> NDArray[np.bool_]:
    """Whether surface points (..., 3) km, body-fixed, see the Sun's centre: (...)."""
    return np.asarray(points_km) / np.asarray(target.radii_km) @ sun_in_radii(pose, target) > 1.0
