"""From places on the body to the pixels that see them: the inverse of the projection."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.pixels import seen_at
from tasks.project.points import surface_points, visible
from tasks.project.sight import Sight, sight_of

Array = NDArray[np.float64]
LIGHT_TIME_ROUNDS = 3  # Jupiter turns by 2e-3 deg while light passes it, and the next round changes 1e-9 of that
SAME_POINT = 1e-3  # of the mean radius: a shape model hides a place where a pixel sees a point farther away than this


def pixels_of_places(
    pose: Pose, camera: Camera, target: Target, latitude_deg: ArrayLike, longitude_deg: ArrayLike
) -> Array:
    """Undistorted pixels (..., 2) that see the places of planetocentric latitude and east longitude, degrees (...).

    Places and pixels belong together as in `project_planes`, with light time and stellar aberration of each pixel where
    the pose knows velocities. NaN for places that the body hides, that are behind the camera or on no body (latitude
    beyond 90 degrees); a pixel may lie outside the frame. On a shape model the outermost point at a latitude and
    longitude is meant. Raises RefusedError when the pose puts the spacecraft inside the target.
    """
    sight = sight_of(pose, target)
    latitude, longitude = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (latitude_deg, longitude_deg)))
    latitude = np.where(np.abs(latitude) <= 90.0, latitude, np.nan)
    fixed = longitude
    for _ in range(LIGHT_TIME_ROUNDS):
        points = _surface(target, latitude, fixed)
        away_km = sight.range_scale * np.linalg.norm(sight.spacecraft_km - points, axis=-1) - sight.range_km
        turn = sight.turn_deg_per_km * away_km
        if not np.any(turn):
            break
        fixed = longitude - turn
    pixels = _projected(sight, camera, points)
    return np.where(_is_seen(pose, camera, target, points, pixels)[..., None], pixels, np.nan)


def _projected(sight: Sight, camera: Camera, points_km: Array) -> Array:
    return camera.project((points_km - sight.spacecraft_km) @ np.linalg.inv(sight.body_from_camera).T)


def _surface(target: Target, latitude_deg: Array, longitude_deg: Array) -> Array:
    if target.shape is None:
        return surface_points(target, latitude_deg, longitude_deg)
    from tasks.project.mesh import mesh_of
    from tasks.project.mesh_radial import outermost_points

    return outermost_points(mesh_of(target), latitude_deg, longitude_deg)


def _is_seen(pose: Pose, camera: Camera, target: Target, points_km: Array, pixels: Array) -> NDArray[np.bool_]:
    if target.shape is None:
        return visible(pose, target, points_km)
    on_body, seen = seen_at(pose, camera, target, pixels)
    away = np.full(on_body.shape, np.inf)
    away[on_body] = np.linalg.norm(seen.points_km - points_km[on_body], axis=-1)
    return away < SAME_POINT * target.mean_radius_km
