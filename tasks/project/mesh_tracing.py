"""Which triangle each pixel sees, by Mitsuba's ray tracing, in spite of its single precision.

Pinhole coordinates (x/z, y/z, 1/z) keep planes plane and turn the camera's lines of sight into parallels: so the
triangles are transformed in double precision into a small box around the body, an orthographic sensor finds the first
one along each line, and the point on it is computed in double precision. Mitsuba's rounding only ever decides between
neighbours along an edge.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import Target
from tasks.project.backplanes import Window
from tasks.project.mesh import Mesh
from tasks.project.rays import spacecraft_in_radii
from tasks.project.sight import sight_of
from tasks.renderer import mitsuba, rendered

Array = NDArray[np.float64]
NEAR = 3.0  # of the sensor from the box's middle; the box reaches from -1 to 1


def triangles_under_pixels(pose: Pose, camera: Camera, target: Target, mesh: Mesh, window: Window) -> NDArray[np.int64]:
    """Index (ny, nx) of the face that each pixel's centre sees; -1 off the body.

    Raises RefusedError when a part of the body is not in front of the camera.
    """
    x0, y0, x1, y1 = window
    found = np.full((y1 - y0, x1 - x0), -1, dtype=np.int64)
    box = _Box.around(_pinhole(pose, camera, target, mesh), camera)
    low, high = np.maximum(box.low, (x0, y0)), np.minimum(box.high, (x1, y1))
    if (high <= low).any():
        return found
    box = _Box(box.xy, box.depth, low, high)
    found[low[1] - y0 : high[1] - y0, low[0] - x0 : high[0] - x0] = _first_faces(box, mesh.faces)
    return found


def triangles_under_places(pose: Pose, camera: Camera, target: Target, mesh: Mesh, xy_px: Array) -> NDArray[np.int64]:
    """The same for any places (n, 2) of the undistorted frame: some 10 microseconds each."""
    mi = mitsuba()
    box = _Box.around(_pinhole(pose, camera, target, mesh), camera)
    scene = mi.load_dict({"type": "scene", "body": mitsuba_mesh(box.vertices, mesh.faces)})
    found = np.full(len(xy_px), -1, dtype=np.int64)
    inside = ((xy_px >= box.low) & (xy_px < box.high)).all(axis=1)
    for i, (x, y) in zip(np.nonzero(inside)[0], box.placed(xy_px[inside]), strict=True):
        hit = scene.ray_intersect_preliminary(mi.Ray3f([float(x), float(y), NEAR], [0, 0, -1]))
        found[i] = hit.prim_index if hit.is_valid() else -1
    return found


@dataclass(frozen=True)
class _Box:
    """Vertices in pixels (v, 2) and depth (v,), near is high; low, high: (2,), the half-open range of pixels around
    them, which becomes the box's width."""

    xy: Array
    depth: Array
    low: NDArray[np.int64]
    high: NDArray[np.int64]

    @classmethod
    def around(cls, pinhole: Array, camera: Camera) -> "_Box":
        xy = pinhole[:, :2] * camera.focal_length_px + np.asarray(camera.centre_px)
        near, far = pinhole[:, 2].max(), pinhole[:, 2].min()
        depth = (pinhole[:, 2] - far) / max(near - far, 1e-300) * 2 - 1
        return cls(xy, depth, np.floor(xy.min(axis=0)).astype(int) - 1, np.ceil(xy.max(axis=0)).astype(int) + 2)

    def placed(self, xy: Array) -> Array:
        """Places (n, 2) in the box: its width from -1 to 1, y up."""
        half, middle = (self.high[0] - self.low[0]) / 2, (self.low + self.high - 1) / 2
        return (xy - middle) / half * [1.0, -1.0]

    @property
    def vertices(self) -> Array:
        return np.column_stack([self.placed(self.xy), self.depth])


def _pinhole(pose: Pose, camera: Camera, target: Target, mesh: Mesh) -> Array:
    """(x/z, y/z, 1/z) of the vertices in the camera's frame (v, 3)."""
    spacecraft_in_radii(pose, target)  # refuses a spacecraft inside the target
    sight = sight_of(pose, target)
    seen = (mesh.vertices_km - sight.spacecraft_km) @ np.linalg.inv(sight.body_from_camera).T
    if (seen[:, 2] <= 0).any():
        raise RefusedError(
            Reason.SHAPE_BEHIND_CAMERA,
            f"a part of the shape model of {target.name} is not in front of {camera.name}.",
            "Check the pose; shape models are projected only where the camera has the whole body before it.",
        )
    return np.column_stack([seen[:, :2] / seen[:, 2:], 1.0 / seen[:, 2]])


def _first_faces(box: _Box, faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Index (ny, nx) of the first face along the parallel line of each of the box's pixels; -1 where there is none."""
    mi = mitsuba()
    look = mi.ScalarTransform4f().look_at([0, 0, NEAR], [0, 0, 0], [0, 1, 0])
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "aov", "aovs": "face:prim_index,hit:shape_index"},
            "sensor": {
                "type": "orthographic",
                "to_world": look,
                "near_clip": 0.1,
                "far_clip": 2 * NEAR,
                "film": _film(box.high - box.low),
                "sampler": {"type": "stratified", "sample_count": 1, "jitter": False},
            },
            "body": mitsuba_mesh(box.vertices, faces),
        }
    )
    hits = rendered(scene)
    return np.where(hits[..., -1] > 0, hits[..., -2].astype(np.int64), -1)


def _film(size: NDArray[Any]) -> dict[str, Any]:
    return {
        "type": "hdrfilm",
        "width": int(size[0]),
        "height": int(size[1]),
        "rfilter": {"type": "box"},
        "pixel_format": "luminance",
        "component_format": "float32",
    }


def mitsuba_mesh(vertices: Array, faces: NDArray[np.int64], bsdf: Any = None) -> Any:
    """A Mitsuba mesh of triangles with face normals."""
    mi = mitsuba()
    properties = mi.Properties()
    if bsdf is not None:
        properties["mesh_bsdf"] = bsdf
    mesh = mi.Mesh("body", vertex_count=len(vertices), face_count=len(faces), props=properties)
    values = mi.traverse(mesh)
    values["vertex_positions"] = vertices.astype(np.float32).ravel()
    values["faces"] = faces.astype(np.uint32).ravel()
    values.update()
    return mesh
