"""Points of a shape model by latitude and longitude."""

import numpy as np
from numpy.typing import NDArray

from tasks.project.mesh import Mesh
from tasks.project.mesh_tracing import mitsuba_mesh
from tasks.renderer import mitsuba

Array = NDArray[np.float64]
OUTSIDE = 2.0  # where rays start, in units of the mesh's largest radius


def outermost_points(mesh: Mesh, latitude_deg: Array, longitude_deg: Array) -> Array:
    """Outermost points (..., 3) km, body-fixed, of the mesh at planetocentric latitude and east longitude, degrees
    (...); NaN where these are NaN. Mitsuba finds the triangle, in single precision; the point on its plane is computed
    in double precision."""
    mi = mitsuba()
    latitude, longitude = np.radians(latitude_deg), np.radians(longitude_deg)
    outward = np.stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], axis=-1
    )
    scene = mi.load_dict({"type": "scene", "body": mitsuba_mesh(mesh.vertices_km / mesh.radius_km, mesh.faces)})
    points = np.full(outward.shape, np.nan)
    for place in zip(*np.nonzero(np.isfinite(outward).all(axis=-1)), strict=True):
        direction = outward[place]
        start = [float(value) for value in OUTSIDE * direction]
        hit = scene.ray_intersect_preliminary(mi.Ray3f(start, [float(-value) for value in direction]))
        if hit.is_valid():
            a, b, c = mesh.vertices_km[mesh.faces[hit.prim_index]]
            normal = np.cross(b - a, c - a)
            points[place] = direction * (normal @ a) / (normal @ direction)
    return points
