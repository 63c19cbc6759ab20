"""What every pixel sees when several bodies are in the frame: the nearest one, its shadows, and the rings before it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.bodies.placed import Body, bodies_of, in_frame, may_shadow
from tasks.bodies.shadow import covered_by_body, covered_by_rings, slant_depth
from tasks.project.backplanes import KNOWN_PLANES, POINT, SUNLIT, Backplanes, Window, full_window
from tasks.project.planes import project_planes
from tasks.project.sight import sight_of

Array = NDArray[np.float64]
# Planes (ny, nx) of one body, by name.
Project = Callable[[Pose, Target], Mapping[str, Array]]


@dataclass(frozen=True)
class Seen:
    """planes: of whichever body each pixel sees, by the names of `Backplanes` (points in that body's frame). body_id:
    (ny, nx) NAIF ids, 0 the sky. shadow: (ny, nx) fraction of the Sun's disk that other bodies and rings cover at the
    surface, NaN where no surface is seen; whether the Sun is up there is another matter (incidence). occulted: pixels
    in which a nearer body stands before the target; ring_depth: (ny, nx) optical depth of the rings between the
    spacecraft and what the pixel sees, 0 without."""

    planes: dict[str, Array]
    body_id: NDArray[np.int32]
    shadow: Array
    occulted: NDArray[np.bool_]
    ring_depth: Array


def has_company(pose: Pose, camera: Camera, target: Target) -> bool:
    """Whether more than the target concerns the frame: another body or a ring in it, or what shadows the target."""
    if not pose.bodies and not target.rings:
        return False
    bodies = bodies_of(pose, target)
    own = next(body for body in bodies if body.place is None)
    if target.rings and in_frame(own, camera):
        return True
    return any(body.place and (in_frame(body, camera) or may_shadow(body, own)) for body in bodies)


def seen_by_frame(pose: Pose, camera: Camera, target: Target, window: Window | None = None) -> Seen:
    """What the pixels of `window` (default: the undistorted frame) see. Raises RefusedError as `project_planes`."""
    window = window or full_window(camera)
    x0, y0, x1, y1 = window
    xy = np.stack(np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)), axis=-1).astype(np.float64)

    def project(pose: Pose, target: Target) -> Mapping[str, Array]:
        shadows = () if target.shape is None else (SUNLIT,)
        return project_planes(pose, camera, target, window, (*KNOWN_PLANES, *shadows)).planes

    return seen_by_places(pose, camera, target, xy, project)


def seen_by_places(pose: Pose, camera: Camera, target: Target, xy_px: Array, project: Project) -> Seen:
    """What places (ny, nx, 2) of the undistorted frame see, NaN places nothing; project: KNOWN_PLANES of one body at
    them."""
    every = bodies_of(pose, target)
    bodies = [body for body in every if body.place is None or in_frame(body, camera)]
    shape = xy_px.shape[:2]
    planes = {name: np.full(shape, np.nan) for name in KNOWN_PLANES}
    nearest, body_id = np.full(shape, np.inf), np.zeros(shape, np.int32)
    on_target, sunlit = np.zeros(shape, np.bool_), np.ones(shape)
    for body in bodies:
        of_body = project(body.pose, body.target)
        there = of_body["range_km"]
        closer = np.isfinite(there) & (there < nearest)
        if body.place is None:
            on_target = np.isfinite(there)
            sunlit = of_body.get(SUNLIT, sunlit)
        for name in KNOWN_PLANES:
            planes[name][closer] = of_body[name][closer]
        nearest[closer], body_id[closer] = there[closer], body.naif_id
    shadow = np.full(shape, np.nan)
    for body in bodies:
        here = body_id == body.naif_id
        if here.any():
            shadow[here] = shadow_on(body, every, np.stack([planes[name][here] for name in POINT], axis=-1))
    if target.shape is not None:
        planes[SUNLIT] = np.where(body_id == target.naif_id, sunlit, np.where(planes["incidence"] < 90, 1.0, 0.0))
    occulted = on_target & (body_id != target.naif_id)
    return Seen(planes, body_id, shadow, occulted, ring_depth_before(bodies, camera, xy_px, nearest))


def shadow_on(body: Body, every: list[Body], points_km: Array) -> Array:
    """Fraction (n,) of the Sun's disk that is covered at points (n, 3) of a body, its frame, by the others, and of the
    light by rings, its own too."""
    left = np.ones(len(points_km))
    for caster in every:
        if caster is not body and may_shadow(caster, body):
            left *= 1.0 - covered_by_body(points_km, body, caster)
        if caster.target.rings and (caster is body or may_shadow(caster, body)):
            left *= 1.0 - covered_by_rings(points_km, body, caster)
    return 1.0 - left


def ring_depth_before(bodies: list[Body], camera: Camera, xy_px: Array, nearest_km: Array) -> Array:
    """Optical depth (ny, nx) of all rings between the spacecraft and what is seen, `nearest_km` (ny, nx) away."""
    depth = np.zeros(xy_px.shape[:2])
    for body in bodies:
        if not body.target.rings:
            continue
        sight = sight_of(body.pose, body.target)
        pinhole = np.concatenate([xy_px, np.ones((*xy_px.shape[:2], 1))], axis=-1).reshape(-1, 3)
        pinhole[:, :2] = (pinhole[:, :2] - camera.centre_px) / camera.focal_length_px
        lines = pinhole @ sight.body_from_camera.T
        lines /= np.linalg.norm(lines, axis=1)[:, None]
        start = np.broadcast_to(sight.spacecraft_km, lines.shape)
        depth += slant_depth(start, lines, body, nearest_km.ravel() / sight.range_scale).reshape(depth.shape)
    return depth


def as_backplanes(seen: Seen, window: Window) -> Backplanes:
    """The planes of whichever body the pixels see."""
    return Backplanes(window, seen.planes)
