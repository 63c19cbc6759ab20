"""The same projection in plain numpy: the yardstick of the compiled one, in tests and in the benchmark."""

from collections.abc import Sequence

import numpy as np

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.planes import PLANES, Array, Planes, Window, full_window
from tasks.project.points import latitude_longitude
from tasks.project.rays import dot, intersect, rays_of, sun_in_radii


def project_planes_with_numpy(
    pose: Pose, camera: Camera, target: Target, window: Window | None = None, planes: Sequence[str] = PLANES
) -> Planes:
    """As `project_planes`, whole arrays at a time: the intersection for all pixels, the angles where they hit."""
    x0, y0, x1, y1 = window = window or full_window(camera)
    rays = rays_of(pose, camera, target)
    xy = np.stack(np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)), axis=-1).astype(np.float64)
    points = intersect(rays, xy)
    on_body = np.isfinite(points[..., 0])
    values = _values(points[on_body], pose, camera, target, planes)
    out = np.full((len(planes), *on_body.shape), np.nan)
    for plane, name in zip(out, planes, strict=True):
        plane[on_body] = values[name]
    return Planes(window, dict(zip(planes, out, strict=True)))


def _values(scaled: Array, pose: Pose, camera: Camera, target: Target, planes: Sequence[str]) -> dict[str, Array]:
    radii = np.asarray(target.radii_km)
    points, normal = scaled * radii, scaled / radii
    to_spacecraft = pose.spacecraft_in_body_km - points
    to_sun = sun_in_radii(pose, target) * radii - points
    values = {}
    if "latitude" in planes or "longitude" in planes:
        values["latitude"], values["longitude"] = latitude_longitude(points)
    if "incidence" in planes:
        values["incidence"] = _angle_deg(normal, to_sun)
    if "emission" in planes:
        values["emission"] = _angle_deg(normal, to_spacecraft)
    if "phase" in planes:
        values["phase"] = _angle_deg(to_spacecraft, to_sun)
    if "range_km" in planes or "resolution_km" in planes:
        distance = np.sqrt(dot(to_spacecraft, to_spacecraft))
        cosine = dot(normal, to_spacecraft) / distance / np.sqrt(dot(normal, normal))
        values["range_km"] = distance[:, 0]
        values["resolution_km"] = (distance / camera.focal_length_px / cosine)[:, 0]
    return values


def _angle_deg(a: Array, b: Array) -> Array:
    cross = np.cross(a, b)
    return np.degrees(np.arctan2(np.sqrt(dot(cross, cross)), dot(a, b)))[:, 0]
