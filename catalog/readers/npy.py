"""Reader of NPY files (NumPy Enhancement Proposal 1): one array of numbers; Python objects in it are never loaded."""

import ast
from pathlib import Path
from typing import Any

import numpy as np

from catalog.errors import RefusedError
from catalog.readers.bands import chosen_plane
from catalog.readers.raw_array import MAX_BANDS, check_end
from catalog.readers.reading import Reading, bytes_at, checked_shape, unreadable
from catalog.reasons import Reason

MAGIC = b"\x93NUMPY"
MAX_HEADER_BYTES = 10_000
# So few numbers along the last axis alone are planes of a picture (grey and alpha, red, green, blue and alpha), as
# matplotlib, Pillow and OpenCV lay them out.
MOST_LAST = 4
GIVE_NUMBERS = "Save whole numbers or reals: np.save(path, array.astype('f4'))."


class NpyReader:
    """NPY, of all versions and byte orders."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """The magic string."""
        return head.startswith(MAGIC)

    def read(self, path: Path, plane: str | None = None) -> Reading:
        """Pixels of an array (ny, nx), or of one plane of (planes, ny, nx) or (ny, nx, planes)."""
        dtype, shape, fortran, offset = _header(path)
        while len(shape) > 2 and 1 in shape:
            shape = _without_ones(shape)
        if len(shape) not in (2, 3) or (fortran and len(shape) != 2):
            fault = f"image {path}: its array has the shape {shape}."
            raise RefusedError(Reason.IMAGE_NOT_2D, fault, "Save one picture (lines, samples).")
        planes_last = len(shape) == 3 and shape[2] <= MOST_LAST < min(shape[:2])
        planes = 1 if len(shape) == 2 else shape[2 if planes_last else 0]
        lines, samples = checked_shape(path, *(shape[:2] if planes_last else shape[-2:]))
        if planes > MAX_BANDS:
            raise unreadable(path, f"its array has {planes} planes")
        number = chosen_plane(path, [""] * planes, plane)
        size = lines * samples * dtype.itemsize
        check_end(path, offset + planes * size)
        if planes_last:
            raw = bytes_at(path, offset, planes * size, "its last line")
            picture = np.frombuffer(raw, dtype).reshape(lines, samples, planes)[..., number]
            return Reading(format="npy", image=np.ascontiguousarray(picture), raw_dn=dtype.kind in "iu")
        raw = bytes_at(path, offset + number * size, size, "its last line")
        pixels = np.frombuffer(raw, dtype)
        picture = pixels.reshape(samples, lines).T if fortran else pixels.reshape(lines, samples)
        return Reading(format="npy", image=np.ascontiguousarray(picture), raw_dn=dtype.kind in "iu")


def _header(path: Path) -> tuple[np.dtype[Any], tuple[int, ...], bool, int]:
    """Type, shape, whether it is stored by columns, and the first number's byte."""
    size = path.stat().st_size
    head = bytes_at(path, 0, min(12, size), "its header")
    if len(head) < 12 or head[6] not in (1, 2, 3):
        raise unreadable(path, "no sound NPY header")
    start = 10 if head[6] == 1 else 12
    length = int.from_bytes(head[8:start], "little")
    if length > MAX_HEADER_BYTES:
        raise unreadable(path, f"its NPY header claims {length} bytes")
    try:
        header = ast.literal_eval(bytes_at(path, start, length, "its header").decode("latin-1").strip())
        dtype, shape, fortran = np.dtype(header["descr"]), header["shape"], header["fortran_order"]
        is_shape = isinstance(shape, tuple) and all(type(side) is int and 0 <= side < 1 << 40 for side in shape)
    except (ValueError, TypeError, KeyError, SyntaxError, MemoryError, RecursionError) as error:
        raise unreadable(path, f"no sound NPY header ({error})") from error
    if dtype.kind == "b":
        dtype = np.dtype("u1")
    if not is_shape or dtype.kind not in "iuf" or dtype.itemsize > 8:
        raise unreadable(path, f"its array holds {dtype} of shape {shape}", GIVE_NUMBERS)
    return dtype, shape, bool(fortran), start + length


def _without_ones(shape: tuple[int, ...]) -> tuple[int, ...]:
    place = shape.index(1)
    return shape[:place] + shape[place + 1 :]
