"""What single pixels see, wherever they are: the projection in plain numpy, for places that form no grid.

It serves frames whose pixels stay on the detector and whose geometry goes through a distortion model; on a grid it is
the yardstick of the compiled projection.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.planes import PLANES, POINT, Array
from tasks.project.points import latitude_longitude
from tasks.project.rays import dot, intersect, rays_of, sun_in_radii
from tasks.project.sight import sight_of


def project_pixels(
    pose: Pose, camera: Camera, target: Target, xy_px: ArrayLike, planes: Sequence[str] = PLANES
) -> dict[str, Array]:
    """What the undistorted pixels `xy_px` (..., 2) see: each of `planes` (some of KNOWN_PLANES) as (...), NaN off the
    body and where a place is NaN. Angles in degrees, lengths in km; resolution_km is that of an undistorted pixel.

    Raises RefusedError when the pose puts spacecraft or Sun inside the target.
    """
    rays = rays_of(pose, camera, target)
    points = intersect(rays, xy_px)
    on_body = np.isfinite(points[..., 0])
    apparent = rays.apparent_at(np.asarray(xy_px, dtype=np.float64)[on_body])
    values = _values(points[on_body], -apparent, pose, camera, target, planes)
    out = {name: np.full(on_body.shape, np.nan) for name in planes}
    for name, plane in out.items():
        plane[on_body] = values[name]
    return out


def _values(
    scaled: Array, to_camera: Array, pose: Pose, camera: Camera, target: Target, planes: Sequence[str]
) -> dict[str, Array]:
    """Planes of points (n, 3) in units of the radii that the camera sees from the directions to_camera (n, 3)."""
    sight, radii = sight_of(pose, target), np.asarray(target.radii_km)
    points, normal = scaled * radii, scaled / radii
    to_spacecraft, to_sun = sight.spacecraft_km - points, sun_in_radii(pose, target) * radii - points
    length = np.sqrt(dot(to_spacecraft, to_spacecraft))
    distance = sight.range_scale * length
    values = dict(zip(POINT, points.T, strict=True))
    if "latitude" in planes or "longitude" in planes:
        values["latitude"], longitude = latitude_longitude(points)
        turned = (longitude + sight.turn_deg_per_km * (distance[:, 0] - sight.range_km)) % 360.0
        values["longitude"] = np.where(turned >= 360.0, 0.0, turned)
    if "incidence" in planes:
        values["incidence"] = _angle_deg(normal, to_sun)
    if "emission" in planes:
        values["emission"] = _angle_deg(normal, to_camera)
    if "phase" in planes:
        values["phase"] = _angle_deg(to_camera, to_sun)
    if "range_km" in planes or "resolution_km" in planes:
        cosine = dot(normal, to_spacecraft) / length / np.sqrt(dot(normal, normal))
        values["range_km"] = distance[:, 0]
        values["resolution_km"] = (distance / camera.focal_length_px / cosine)[:, 0]
    return values


def _angle_deg(a: Array, b: Array) -> Array:
    cross = np.cross(a, b)
    return np.degrees(np.arctan2(np.sqrt(dot(cross, cross)), dot(a, b)))[:, 0]
