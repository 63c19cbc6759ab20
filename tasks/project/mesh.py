"""Shape models: triangles of a body, from DSK kernels and OBJ or PLY files."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.regular_file import check_regular
from catalog.target import Target

Array = NDArray[np.float64]
SUFFIXES = (".bds", ".dsk", ".obj", ".ply")
LARGEST_RATIO = 10.0  # between the mesh's extent and the target's largest radius


@dataclass(frozen=True)
class Mesh:
    """A closed surface of triangles, body-fixed. vertices_km: (v, 3); faces: (f, 3), indices of their corners."""

    vertices_km: Array
    faces: NDArray[np.int64]

    def __post_init__(self) -> None:
        if len(self.faces) == 0 or self.faces.min() < 0 or self.faces.max() >= len(self.vertices_km):
            raise ValueError(f"{len(self.faces)} faces over {len(self.vertices_km)} vertices are no mesh")
        if not np.isfinite(self.vertices_km).all():
            raise ValueError("a vertex is not finite")

    @property
    def radius_km(self) -> float:
        """Largest distance of a vertex from the origin."""
        return float(np.sqrt(np.max(np.einsum("ij,ij->i", self.vertices_km, self.vertices_km))))


def mesh_of(target: Target) -> Mesh:
    """The target's shape model. Raises RefusedError when it has none, or a file that cannot be used."""
    if target.shape is None:
        raise RefusedError(Reason.SHAPE_MISSING, f"target {target.name} has no shape model.", "Give --shape FILE.")
    path = Path(target.shape)
    mesh = read_mesh(path, target.naif_id)
    largest = max(target.radii_km)
    if not largest / LARGEST_RATIO < mesh.radius_km < largest * LARGEST_RATIO:
        raise RefusedError(
            Reason.SHAPE_SIZE,
            f"shape model {path} reaches {mesh.radius_km:.6g} km from its origin; the largest radius of {target.name} "
            f"is {largest:.6g} km.",
            "Shape models are in kilometres, about the body's centre, in its body-fixed frame.",
        )
    return mesh


def read_mesh(path: Path, naif_id: int | None = None) -> Mesh:
    """Mesh of a DSK kernel (type 2 segments, of body `naif_id` where given), an OBJ or a PLY file, in kilometres.

    Raises RefusedError naming the file and the fault.
    """
    path = Path(path)
    remedy = f"Give a file that ends in {', '.join(SUFFIXES)}."
    try:
        found = check_regular(path)
    except FileNotFoundError as error:
        raise RefusedError(Reason.SHAPE_UNREADABLE, f"shape model {path} does not exist.", remedy) from error
    except OSError as error:
        raise RefusedError(Reason.SHAPE_UNREADABLE, f"shape model {path}: {error.strerror}.", remedy) from error
    if path.suffix.lower() not in SUFFIXES:
        raise RefusedError(Reason.SHAPE_UNREADABLE, f"shape model {path} is of no known kind.", remedy)
    return _read(path.absolute(), found.st_mtime_ns, naif_id)


@lru_cache(maxsize=4)
def _read(path: Path, _: int, naif_id: int | None) -> Mesh:
    try:
        return _read_dsk(path, naif_id) if path.suffix.lower() in (".bds", ".dsk") else _read_with_mitsuba(path)
    except (ValueError, RuntimeError) as error:
        fault = " ".join(str(error).split())[:300]
        raise RefusedError(Reason.SHAPE_UNREADABLE, f"shape model {path}: {fault}.", "Is it a whole file?") from error


def _read_with_mitsuba(path: Path) -> Mesh:
    from tasks.renderer import mitsuba

    mi = mitsuba()
    loaded: Any = mi.load_dict({"type": path.suffix.lower()[1:], "filename": str(path), "face_normals": True})
    values = mi.traverse(loaded)
    vertices = np.array(values["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    return Mesh(vertices, np.array(values["faces"], dtype=np.int64).reshape(-1, 3))


def _read_dsk(path: Path, naif_id: int | None) -> Mesh:
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    from catalog.spice import kernel_pool, spice_message

    with kernel_pool([]):
        try:
            handle = spiceypy.dasopr(str(path))
        except SpiceyError as error:
            raise ValueError(spice_message(error)) from error
        try:
            parts = _segments(handle, naif_id)
        except SpiceyError as error:
            raise ValueError(spice_message(error)) from error
        finally:
            spiceypy.dascls(handle)
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [plates + first for (_, plates), first in zip(parts, counts[:-1], strict=True)]
    return Mesh(np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces))


def _segments(handle: int, naif_id: int | None) -> list[tuple[Array, NDArray[np.int64]]]:
    import spiceypy

    parts, bodies = [], set()
    with spiceypy.no_found_check():
        segment, found = spiceypy.dlabfs(handle)
        while found:
            about = spiceypy.dskgd(handle, segment)
            bodies.add(about.center)
            if about.dtype == 2 and naif_id in (None, about.center):
                vertex_count, plate_count = spiceypy.dskz02(handle, segment)
                vertices = np.array(spiceypy.dskv02(handle, segment, 1, vertex_count), dtype=np.float64)
                plates = np.array(spiceypy.dskp02(handle, segment, 1, plate_count), dtype=np.int64) - 1
                parts.append((vertices.reshape(-1, 3), plates.reshape(-1, 3)))
            segment, found = spiceypy.dlafns(handle, segment)
    if not parts:
        raise ValueError(f"it has no plates (DSK type 2) of body {naif_id}, but of {sorted(bodies)}")
    return parts
