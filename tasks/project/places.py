"""From places on the body to the pixels that see them: the inverse of the projection."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.pixels import seen_at
from tasks.project.points import surface_points, visible
from tasks.project.rays import rays_of
from tasks.project.seen import Seen
from tasks.project.sight import Sight, sight_of

Array = NDArray[np.float64]
LIGHT_TIME_ROUNDS = 3  # Jupiter turns by 2e-3 deg while light passes it, and the next round changes 1e-9 of that
SAME_POINT = 1e-3  # of the mean radius: a shape model hides a place where a pixel sees a point farther away than this


@dataclass(frozen=True)
class Places:
    """Places on the body as an image has them. points_km: (..., 3), body-fixed, NaN on no body. pixels: (..., 2),
    undistorted, also of places that the body hides; NaN behind the camera. visible: (...), whether the image sees
    them, be it outside of its frame."""

    points_km: Array
    pixels: Array
    visible: NDArray[np.bool_]


def pixels_of_places(
    pose: Pose, camera: Camera, target: Target, latitude_deg: ArrayLike, longitude_deg: ArrayLike
) -> Array:
    """Undistorted pixels (..., 2) that see the places of planetocentric latitude and east longitude, degrees (...).

    Places and pixels belong together as in `project_planes`, with light time and stellar aberration of each pixel where
    the pose knows velocities. NaN for places that the body hides, that are behind the camera or on no body (latitude
    beyond 90 degrees); a pixel may lie outside the frame. On a shape model the outermost point at a latitude and
    longitude is meant. Raises RefusedError when the pose puts the spacecraft inside the target.
    """
    places = find_places(pose, camera, target, latitude_deg, longitude_deg)
    return np.where(places.visible[..., None], places.pixels, np.nan)


def find_places(
    pose: Pose, camera: Camera, target: Target, latitude_deg: ArrayLike, longitude_deg: ArrayLike
) -> Places:
    """The same with the points themselves, and with the pixels that hidden ones would have."""
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
    seen = _is_seen(pose, camera, target, points, pixels) & np.isfinite(pixels).all(axis=-1)
    return Places(points, pixels, seen)


def geometry_of_places(pose: Pose, camera: Camera, target: Target, places: Places) -> Seen:
    """Angles and ranges of n places (points (n, 3)), also of those that an ellipsoid hides. On a shape model they are
    those of its ellipsoid's normals where the place is hidden, of the triangle that is seen where it is not."""
    radii = np.asarray(target.radii_km)
    normals = places.points_km / radii**2
    if target.shape is not None:
        on_body, seen = seen_at(pose, camera, target, np.where(places.visible[:, None], places.pixels, np.nan))
        normals[on_body] = seen.normals
    to_camera = -rays_of(pose, camera, target).apparent_at(places.pixels)
    return Seen(pose, camera, target, places.points_km, normals, to_camera)


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
