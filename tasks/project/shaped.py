"""The projection onto a shape model: the same planes as on the ellipsoid, with the normals of its triangles."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.backplanes import PLANES, SUNLIT, Backplanes, Window, full_window
from tasks.project.mesh import Mesh, mesh_of
from tasks.project.mesh_shadow import sunlit_faces_under
from tasks.project.mesh_tracing import triangles_under_pixels, triangles_under_places
from tasks.project.seen import Seen, scattered
from tasks.project.sight import sight_of

Array = NDArray[np.float64]


def project_mesh_planes(
    pose: Pose, camera: Camera, target: Target, window: Window | None = None, planes: Sequence[str] = PLANES
) -> Backplanes:
    """As `project_planes`, on the target's shape model. Emission, incidence: from the seen triangle's normal.

    Raises RefusedError when the pose puts spacecraft or Sun inside the target, or the camera has not the whole body
    before it.
    """
    window = window or full_window(camera)
    on_body, seen = mesh_seen(pose, camera, target, window, shadows=SUNLIT in planes)
    return Backplanes(window, scattered(on_body, seen, planes))


def mesh_seen(
    pose: Pose, camera: Camera, target: Target, window: Window, shadows: bool = False
) -> tuple[NDArray[np.bool_], Seen]:
    """Which pixels (ny, nx) of `window` see the shape model, and the points that those see. shadows: with `lit`, what
    other parts of the body do not hide from the Sun."""
    mesh = mesh_of(target)
    faces = triangles_under_pixels(pose, camera, target, mesh, window)
    on_body = faces >= 0
    rows, columns = np.nonzero(on_body)
    xy = np.stack([columns + window[0], rows + window[1]], axis=-1).astype(np.float64)
    seen = _seen(pose, camera, target, mesh, xy, faces[on_body])
    if shadows:
        lit = sunlit_faces_under(pose, camera, target, mesh, window)[on_body]
        seen = replace(seen, lit=lit)
    return on_body, seen


def mesh_seen_at(
    pose: Pose, camera: Camera, target: Target, xy_px: Array, shadows: bool = False
) -> tuple[NDArray[np.bool_], Seen]:
    """The same for any places (..., 2) of the undistorted frame. Whole pixels are traced together; others one by one,
    and their shadows are those of the nearest whole pixel."""
    mesh, on_body = mesh_of(target), np.zeros(xy_px.shape[:-1], dtype=np.bool_)
    known = np.isfinite(xy_px).all(axis=-1)
    xy = xy_px[known]
    if not len(xy):
        return on_body, _seen(pose, camera, target, mesh, xy, np.zeros(0, dtype=np.int64))
    nearest = np.rint(xy).astype(np.int64)
    low, high = nearest.min(axis=0), nearest.max(axis=0) + 1
    window, (x, y) = (int(low[0]), int(low[1]), int(high[0]), int(high[1])), (nearest - low).T
    if np.array_equal(nearest, xy):
        faces = triangles_under_pixels(pose, camera, target, mesh, window)[y, x]
    else:
        faces = triangles_under_places(pose, camera, target, mesh, xy)
    on_body[known] = faces >= 0
    seen = _seen(pose, camera, target, mesh, xy[faces >= 0], faces[faces >= 0])
    if shadows:
        seen = replace(seen, lit=sunlit_faces_under(pose, camera, target, mesh, window)[y, x][faces >= 0])
    return on_body, seen


def _seen(pose: Pose, camera: Camera, target: Target, mesh: Mesh, xy_px: Array, faces: NDArray[np.int64]) -> Seen:
    from tasks.project.mesh_kernel import meet_faces

    sight, out = sight_of(pose, target), np.empty((9, len(faces)))
    maps = (np.ascontiguousarray(m) for m in (sight.spacecraft_km, sight.body_from_camera, sight.apparent_from_camera))
    pinhole = (np.asarray(camera.centre_px), float(camera.focal_length_px))
    meet_faces(np.ascontiguousarray(xy_px), faces, mesh.vertices_km, mesh.faces, *maps, *pinhole, out)
    return Seen(pose, camera, target, out[:3].T, out[3:6].T, out[6:].T)
