"""Pixels that say nothing of the target: those of bodies before and beside it, rings, and shadows on it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.target import Target
from tasks.bodies.placed import Body, bodies_of, in_frame
from tasks.bodies.seen import seen_by_frame
from tasks.project.curves import limb
from tasks.simulate import Scene
from tasks.simulate.others import OtherBodiesSettings
from tasks.simulate.window import Window, target_window

Mask = NDArray[np.bool_]

DEFAULTS = OtherBodiesSettings()
LIMB_POINTS = 1440
FIXED_POINT_BITS = 4


def alone(
    observation: Observation, pose: Pose, scene: Scene, extra_px: float = 0.0, keep_behind: bool = True
) -> Observation:
    """The observation with OTHER_BODY where, at `pose`, the light is that of another body or of rings, where they hide
    the target, and where they shadow it; the same object where no other body concerns the frame. extra_px: how far off
    the pose may be. keep_behind: leave the light of a body behind the target where the target's limb is before it."""
    if not pose.bodies and not scene.target.rings:
        return observation
    camera, psf, margins = scene.camera, scene.psf_sigma_px, scene.settings.others
    mask = without_target(pose, camera, scene.target, psf, extra_px, keep_behind, margins)
    if not mask.any():
        return observation
    flag = np.where(mask, np.uint16(Quality.OTHER_BODY), np.uint16(0))
    return replace(observation, quality=(observation.quality | flag).astype(np.uint16))


def without_target(
    pose: Pose,
    camera: Camera,
    target: Target,
    psf_sigma_px: float,
    extra_px: float = 0.0,
    keep_behind: bool = True,
    settings: OtherBodiesSettings = DEFAULTS,
) -> Mask:
    """Pixels (ny, nx) of the undistorted frame that say nothing of the target, or may not."""
    nx, ny = camera.size_px
    mask = np.zeros((ny, nx), np.bool_)
    blur_px = settings.blur_sigmas * psf_sigma_px + settings.pixel_px + extra_px
    bodies = bodies_of(pose, target)
    own = next(body for body in bodies if body.place is None)
    disk, kept = disk_of(own, camera), kept_px(own, camera, psf_sigma_px, settings)
    for body in bodies:
        margin = blur_px + place_px(body, camera, settings)
        if body is own or not in_frame(body, camera, margin):
            continue
        other = grown(disk_of(body, camera), margin)
        if body.pose.range_km <= own.pose.range_km:
            mask |= other
            continue
        if not keep_behind:
            other &= ~grown(disk, -blur_px)
        elif disk.any() and not (grown(disk, kept) & ~disk_of(body, camera)).any():
            continue  # wholly before the other body: what is around the target is all that light, known as it is
        elif (disk_of(body, camera) & disk).any():
            # A moon before its planet: near the limb the planet's light is what the moon hides.
            other &= ~grown(disk, kept)
        mask |= other
    mask |= shadows_and_rings(pose, camera, target, bodies, blur_px, settings)
    return mask


def kept_px(own: Body, camera: Camera, psf_sigma_px: float, settings: OtherBodiesSettings) -> float:
    """How far beyond the target's limb the light behind it is looked at (`tasks.compare.occulted`): it is what the
    target hides."""
    return settings.kept_px + settings.kept_radii * own.radius_px(camera) + settings.kept_sigmas * psf_sigma_px


def place_px(body: Body, camera: Camera, settings: OtherBodiesSettings) -> float:
    """How far a body's edge may be from where it is placed relative to the target, pixels."""
    if body.place is None:
        return 0.0
    sigma_km = float(np.hypot(body.place.sigma_km, body.place.relief_km))
    return float(settings.place_sigmas * sigma_km * camera.focal_length_px / body.pose.range_km)


def shadows_and_rings(
    pose: Pose, camera: Camera, target: Target, bodies: list[Body], blur_px: float, settings: OtherBodiesSettings
) -> Mask:
    """Pixels (ny, nx) in which the target lies in a shadow, and in which rings stand before it or beside it."""
    nx, ny = camera.size_px
    mask = np.zeros((ny, nx), np.bool_)
    own = next(body for body in bodies if body.place is None)
    around = target_window(pose, camera, target, 2.0).clipped((nx, ny))
    ringed = any(body.target.rings and in_frame(body, camera) for body in bodies)
    if ringed:
        around = Window(0, 0, nx, ny)
    if min(around.shape) < 1:
        return mask
    window = (around.x0, around.y0, around.x1, around.y1)
    seen = seen_by_frame(pose, camera, target, window)
    shaded = (seen.body_id == target.naif_id) & (seen.shadow > settings.least_loss)
    km_px = camera.focal_length_px / own.pose.range_km
    places = [body.place.sigma_km for body in bodies if body.place is not None]
    margin = blur_px + settings.place_sigmas * km_px * max(places, default=0.0)
    lost = shaded | (-np.expm1(-seen.ring_depth) > settings.least_loss)
    part = mask[around.y0 : around.y1, around.x0 : around.x1]
    part |= grown(lost, margin)
    return mask


def disk_of(body: Body, camera: Camera) -> Mask:
    """Pixels (ny, nx) of the frame within a body's limb, lit or not."""
    import cv2

    nx, ny = camera.size_px
    disk = np.zeros((ny, nx), np.uint8)
    xy = limb(body.pose, camera, body.target, LIMB_POINTS).xy_px
    xy = xy[np.isfinite(xy).all(axis=1)]
    if len(xy) > 2:
        scaled = np.rint(np.clip(xy, -1e7, 1e7) * 2**FIXED_POINT_BITS).astype(np.int32)
        cv2.fillPoly(disk, [scaled], 1, shift=FIXED_POINT_BITS)
    return disk > 0


def grown(mask: Mask, by_px: float) -> Mask:
    """The mask and what is within `by_px` of it; without what is within so much of its edge where that is negative."""
    import cv2

    if not mask.any() or by_px == 0:
        return mask
    if by_px < 0:
        return ~grown(~mask, -by_px)
    return np.asarray(cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5) <= by_px)
