"""Curves to draw over an image or to compare with it: limb, terminator, latitude and longitude lines."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.points import illuminated, pixels_of_points, surface_points, visible
from tasks.project.rays import spacecraft_in_radii, sun_in_radii

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """A curve on the surface. xy_px: (n, 2) undistorted pixels, NaN behind the camera. points_km: (n, 3) body-fixed.
    visible, illuminated: (n,), whether each point faces the spacecraft and the Sun. On the limb all are visible."""

    name: str
    xy_px: Array
    points_km: Array
    visible: NDArray[np.bool_]
    illuminated: NDArray[np.bool_]

    @property
    def visible_xy_px(self) -> Array:
        """xy_px (n, 2) with NaN at the hidden points, so that a plotted line is interrupted there."""
        return np.where(self.visible[:, None], self.xy_px, np.nan)


def _silhouette(viewpoint: Array, n: int) -> Array:
    """Points (n, 3) where the unit sphere's silhouette, seen from `viewpoint` (3,) outside, touches it."""
    distance2 = float(viewpoint @ viewpoint)
    axis = viewpoint / np.sqrt(distance2)
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    angle = np.linspace(0.0, 2 * np.pi, n, endpoint=False)[:, None]
    circle = np.cos(angle) * first + np.sin(angle) * np.cross(axis, first)
    return viewpoint / distance2 + circle * np.sqrt(1.0 - 1.0 / distance2)


def limb(pose: Pose, camera: Camera, target: Target, n: int = 720) -> Curve:
    """The analytic limb: n points of the ellipsoid's silhouette as seen from the spacecraft, in order around the disk.

    Closed form for a triaxial body: in units of the radii the silhouette is a circle. Undistorted frame; the points may
    lie outside the frame. Raises RefusedError when the pose puts the spacecraft inside the target.
    """
    points = _silhouette(spacecraft_in_radii(pose, target), n) * np.asarray(target.radii_km)
    xy = pixels_of_points(pose, camera, points)
    return Curve("limb", xy, points, np.ones(n, dtype=np.bool_), illuminated(pose, target, points))


def limb_points(pose: Pose, camera: Camera, target: Target, n: int = 720) -> Array:
    """Pixels (n, 2) of the analytic limb; see `limb`, which also says where the limb is illuminated."""
    return limb(pose, camera, target, n).xy_px


def terminator(pose: Pose, camera: Camera, target: Target, n: int = 720) -> Curve:
    """The terminator: n points, in order, where the Sun's centre stands on the horizon; `visible` marks the near side.

    Raises RefusedError when the pose puts the spacecraft inside the target.
    """
    points = _silhouette(sun_in_radii(pose, target), n) * np.asarray(target.radii_km)
    xy = pixels_of_points(pose, camera, points)
    return Curve("terminator", xy, points, visible(pose, target, points), np.ones(n, dtype=np.bool_))


def graticule(pose: Pose, camera: Camera, target: Target, step_deg: float = 30.0, n: int = 181) -> list[Curve]:
    """Parallels (equator first) and meridians every `step_deg`, named `latitude -30` or `longitude 120` (east)."""
    parallels = np.arange(0.0, 90.0 - 1e-6, step_deg)
    latitudes = np.concatenate([parallels, -parallels[1:]])
    longitudes = np.arange(0.0, 360.0 - 1e-6, step_deg)
    around, pole_to_pole = np.linspace(0.0, 360.0, 2 * n - 1), np.linspace(-90.0, 90.0, n)
    lines = {f"latitude {lat:g}": surface_points(target, lat, around) for lat in latitudes}
    lines |= {f"longitude {lon:g}": surface_points(target, pole_to_pole, lon) for lon in longitudes}
    return [_curve(name, pose, camera, target, points) for name, points in lines.items()]


def _curve(name: str, pose: Pose, camera: Camera, target: Target, points: Array) -> Curve:
    xy = pixels_of_points(pose, camera, points)
    return Curve(name, xy, points, visible(pose, target, points), illuminated(pose, target, points))
