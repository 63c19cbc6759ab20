"""What falls on the focal plane: the true surface seen by an ideal pinhole, blurred and integrated over pixels.

Rays meet the ellipsoid analytically in double precision: nothing is shared with the simulations of the corrections but
the shape of the body.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from lab.simulate.surface import TrueSurface
from tasks.project.rays import Rays, intersect, rays_of
from tasks.simulate.scene import detect
from tasks.simulate.window import Window, disk_radius_px, target_window

BRIGHT_PERCENTILE = 99.0
SIDE_OF_A_SMOOTH_DISK = 700  # sub-pixels across a disk
LIMB_PARTS = 6  # sub-pixels that the limb cuts are made of so many parts per side


@dataclass(frozen=True)
class Picture:
    """brightness float32 (ny, nx) under `window` of the undistorted frame; the lit disk's bright parts are at 1."""

    window: Window
    brightness: NDArray[np.float32]


def picture_of(
    pose: Pose,
    camera: Camera,
    target: Target,
    surface: TrueSurface,
    psf_sigma_px: float,
    oversample: int | None = None,
) -> Picture:
    """The picture of `target`; oversample: sub-pixels per pixel side, None chooses by the size of the disk."""
    import cv2

    window = target_window(pose, camera, target)
    s = oversample or int(np.clip(np.ceil(SIDE_OF_A_SMOOTH_DISK / (2 * disk_radius_px(pose, camera, target))), 2, 7))
    x = window.x0 - 0.5 + (np.arange((window.x1 - window.x0) * s) + 0.5) / s
    y = window.y0 - 0.5 + (np.arange((window.y1 - window.y0) * s) + 0.5) / s
    seen_from, xy = rays_of(pose, camera, target), np.stack(np.meshgrid(x, y), axis=-1)
    fine, hit = _seen(xy, seen_from, pose, target, surface)
    # A limb sampled at the sub-pixels' centres alone lies up to 0.02 px off.
    cut = cv2.morphologyEx(hit.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0
    part = ((np.arange(LIMB_PARTS) + 0.5) / LIMB_PARTS - 0.5) / s
    parts = np.stack(np.meshgrid(part, part), axis=-1).reshape(-1, 2)
    fine[cut] = _seen(xy[cut][:, None] + parts, seen_from, pose, target, surface)[0].mean(axis=1)
    lit = detect((fine > 0).astype(np.float32), s, psf_sigma_px) > 0.5
    brightness = detect(fine, s, psf_sigma_px)
    peak = np.percentile(brightness[lit], BRIGHT_PERCENTILE) if lit.any() else 1.0
    return Picture(window, (brightness / np.float32(peak)).astype(np.float32))


def _seen(
    xy_px: NDArray[np.float64], seen_from: Rays, pose: Pose, target: Target, surface: TrueSurface
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Brightness (...) at places (..., 2) of the frame, 0 off the body, and whether the body is there."""
    places = intersect(seen_from, xy_px)
    hit = np.isfinite(places[..., 0])
    value = np.zeros(hit.shape, np.float32)
    value[hit] = _brightness(places[hit], pose, target, surface)
    return value, hit


def _brightness(places: NDArray[np.float64], pose: Pose, target: Target, surface: TrueSurface) -> NDArray[np.float64]:
    radii = np.asarray(target.radii_km)
    body_km = places * radii
    normal = places / radii
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    to_camera = pose.spacecraft_in_body_km - body_km
    to_camera /= np.linalg.norm(to_camera, axis=-1, keepdims=True)
    to_sun = pose.sun_direction_in_body
    unit = body_km / np.linalg.norm(body_km, axis=-1, keepdims=True)
    mu0 = np.maximum(normal @ to_sun, 0)
    mu = np.maximum((normal * to_camera).sum(axis=-1), 0)
    return surface.brightness(unit, mu0, mu, to_camera @ to_sun)
