"""Which pixels of a shape model the Sun reaches: Mitsuba's direct light, whose shadow rays the body itself stops."""

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.backplanes import Window
from tasks.project.mesh import Mesh
from tasks.project.mesh_tracing import mitsuba_mesh
from tasks.project.rays import sun_in_radii
from tasks.project.sight import sight_of
from tasks.renderer import mitsuba, rendered


def sunlit_faces_under(pose: Pose, camera: Camera, target: Target, mesh: Mesh, window: Window) -> NDArray[np.bool_]:
    """Whether light of the Sun's centre falls on what each pixel's centre sees (ny, nx); False off the body.

    In single precision and in units of the body: the place of a shadow's edge is good to about 1e-7 of the range.
    """
    mi = mitsuba()
    x0, y0, x1, y1 = window
    nx, ny = x1 - x0, y1 - y0
    sight, unit = sight_of(pose, target), mesh.radius_km
    left, _, right = np.linalg.svd(sight.body_from_camera)
    to_world = np.eye(4)
    to_world[:3, :3] = left @ right @ np.diag([-1.0, -1.0, 1.0])  # Mitsuba looks along +Z, +X left, +Y up
    to_world[:3, 3] = sight.spacecraft_km / unit
    distance = float(np.linalg.norm(to_world[:3, 3]))
    sun = sun_in_radii(pose, target) * np.asarray(target.radii_km)
    axis = np.asarray(camera.centre_px) - ((x0 + x1 - 1) / 2, (y0 + y1 - 1) / 2)
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0, "hide_emitters": True},
            "sun": {"type": "directional", "direction": (-sun / np.linalg.norm(sun)).tolist()},
            "sensor": {
                "type": "perspective",
                "fov_axis": "x",
                "fov": float(np.degrees(2 * np.arctan(nx / 2 / camera.focal_length_px))),
                "to_world": mi.ScalarTransform4f(to_world.tolist()),
                "near_clip": max(distance - 1.1, 1e-3),
                "far_clip": distance + 1.1,
                "principal_point_offset_x": float(-axis[0] / nx),
                "principal_point_offset_y": float(-axis[1] / ny),
                "film": {
                    "type": "hdrfilm",
                    "width": nx,
                    "height": ny,
                    "rfilter": {"type": "box"},
                    "pixel_format": "luminance",
                    "component_format": "float32",
                },
                "sampler": {"type": "stratified", "sample_count": 1, "jitter": False},
            },
            "body": mitsuba_mesh(mesh.vertices_km / unit, mesh.faces, _white()),
        }
    )
    return rendered(scene)[..., 0] > 0


def _white() -> object:
    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}
    return mitsuba().load_dict({"type": "twosided", "bsdf": white})
