"""How fast the projection onto a shape model is on this machine, and how near a ball of triangles is to the sphere."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from catalog.target import Target
from lab.benchmark.projection import EUROPA, frame_filling_scene
from tasks.project.backplanes import ANGLES, Backplanes
from tasks.project.mesh import Mesh
from tasks.project.planes import project_planes

STEEP_DEG = 60.0


def benchmark_mesh(size: int = 1024, facets: int = 200_000) -> dict[str, Any]:
    """Five planes of a size x size frame that a sphere of about `facets` triangles fills: seconds and processor seconds
    of the second call (the first reads the file), and differences from the sphere itself by plane, at emission below
    60 deg: the largest and the root mean square, degrees. A triangle's normal is half its size off, its place is not.
    """
    pose, camera = frame_filling_scene(size)
    sphere = EUROPA.model_copy(update={"radii_km": (EUROPA.mean_radius_km,) * 3})
    mesh = sphere_of_triangles(round(np.sqrt(facets / 4)), EUROPA.mean_radius_km)
    with TemporaryDirectory() as folder:
        shaped = sphere.with_shape(write_obj(mesh, Path(folder) / "sphere.obj"))
        first_s, _, ours = _timed(pose, camera, shaped)
        second_s, processor_s, ours = _timed(pose, camera, shaped)
    exact = project_planes(pose, camera, sphere, planes=ANGLES)
    return {
        "size_px": [size, size],
        "facets": len(mesh.faces),
        "seconds": second_s,
        "processor_seconds": processor_s,
        "first_call_s": first_s,
        "pixels_seen_by_one_only": int((ours.on_body != exact.on_body).sum()),
        "differences_deg": {name: _difference(name, ours, exact) for name in ANGLES},
    }


def _timed(pose: Any, camera: Any, target: Target) -> tuple[float, float, Backplanes]:
    started, processor = time.perf_counter(), time.process_time()
    planes = project_planes(pose, camera, target, planes=ANGLES)
    return time.perf_counter() - started, time.process_time() - processor, planes


def _difference(name: str, ours: Backplanes, exact: Backplanes) -> dict[str, float]:
    compared = ours.on_body & (exact.emission < STEEP_DEG)
    off = np.abs((ours[name] - exact[name] + 180) % 360 - 180)[compared]
    off = off * np.cos(np.radians(exact.latitude[compared])) if name == "longitude" else off
    return {"largest": float(off.max()), "rms": float(np.sqrt(np.mean(off**2)))}


def sphere_of_triangles(n: int, radius_km: float) -> Mesh:
    """About 4 n^2 triangles between n + 1 parallels and 2 n meridians."""
    latitude, longitude = np.meshgrid(np.linspace(-90, 90, n + 1), np.arange(2 * n) * 180 / n, indexing="ij")
    lat, lon = np.radians(latitude).ravel(), np.radians(longitude).ravel()
    vertices = radius_km * np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1)
    row, column = np.meshgrid(np.arange(n), np.arange(2 * n), indexing="ij")
    a, b = (row * 2 * n + c % (2 * n) for c in (column, column + 1))
    below, above = np.stack([a, b, b + 2 * n], -1)[1:], np.stack([a, b + 2 * n, a + 2 * n], -1)[:-1]
    return Mesh(vertices, np.concatenate([below.reshape(-1, 3), above.reshape(-1, 3)]))


def write_obj(mesh: Mesh, path: Path) -> Path:
    """Write `mesh` as an OBJ file and return its path."""
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}\n" for x, y, z in mesh.vertices_km]
    path.write_text("".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in mesh.faces)]))
    return path
