"""Reseau tables that the PDS Ring Node keeps beside its Voyager images: GEOMA and RESLOC, .DAT (IBIS) and .TAB (text).

A .DAT file is a VICAR file of type IBIS: rows of VAX reals behind the label (RESLOC: five integers first).
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.regular_file import read_regular
from catalog.reseau import ReseauTable

SAME_MARK_PX = 1.0
RESLOC_INTEGERS = 5  # FDS count, camera, filter, year, day
MAX_TABLE_BYTES = 1_000_000
REMEDY = "Give a GEOMA or RESLOC file (.DAT or .TAB) of the PDS Ring Node's Voyager volumes."


def is_archive_table(path: Path) -> bool:
    """Whether a file's name says that it is one of the Ring Node's reseau tables."""
    return bool(re.search(r"(GEOMA|RESLOC)\.(DAT|TAB)$", path.name, re.IGNORECASE))


def read_archive_marks(path: Path, table: ReseauTable) -> ReseauTable:
    """The marks of `table` with the raw places that a GEOMA or RESLOC file gives for one image.

    Raises RefusedError when the file cannot be read, or does not hold the marks of this camera.
    """
    if "RESLOC" in path.name.upper():
        rows = _rows(path)
        if len(rows) != len(table):
            raise _refused(path, f"it holds {len(rows)} marks, the camera has {len(table)}")
        raw_xy = rows[:, [1, 0]] - 1.0
    else:
        object_xy, raw_of_node = read_tiepoints(path)
        distance = np.linalg.norm(table.object_xy[:, None] - object_xy[None], axis=2)
        nearest = distance.argmin(axis=1)
        if distance.min(axis=1).max() > SAME_MARK_PX:
            raise _refused(path, f"its tiepoints are not the marks of {table.name}")
        raw_xy = raw_of_node[nearest]
    return ReseauTable(path.stem, table.index, raw_xy, table.object_xy)


def read_tiepoints(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Undistorted and raw places, each (n, 2) pixels (x, y), 0-based, of all nodes of a GEOMA table: the marks and the
    points that VICAR put between them. Raises RefusedError when the file cannot be read."""
    rows = _rows(path)
    if rows.shape[1] != 4:
        raise _refused(path, "it holds no tiepoints")
    return rows[:, [1, 0]] - 1.0, rows[:, [3, 2]] - 1.0


def _rows(path: Path) -> NDArray[np.float64]:
    """Rows (n, 2 or 4) of lines and samples, 1-based."""
    try:
        content = read_regular(path)
    except OSError as error:
        raise _refused(path, f"it cannot be read ({error})") from error
    if len(content) > MAX_TABLE_BYTES:
        raise _refused(path, f"it has {len(content)} bytes")
    rows = _binary_rows(path, content) if content.startswith(b"LBLSIZE=") else _text_rows(path, content)
    if not len(rows) or not np.isfinite(rows).all() or np.abs(rows).max() > 2000:
        raise _refused(path, "its values are no lines and samples")
    return rows


def _text_rows(path: Path, content: bytes) -> NDArray[np.float64]:
    """Comma-separated text: a row number, then lines and samples."""
    try:
        lines = content.decode("ascii").splitlines()
        rows = np.array([line.split(",") for line in lines if line.strip()], dtype=np.float64)
    except (UnicodeDecodeError, ValueError) as error:
        raise _refused(path, f"it is no table of numbers ({error})") from error
    if rows.ndim != 2 or rows.shape[1] not in (3, 5):
        raise _refused(path, "its rows hold neither one nor two pairs of coordinates")
    return rows[:, 1:]


def _binary_rows(path: Path, content: bytes) -> NDArray[np.float64]:
    import vax

    label_bytes = _label_number(path, content, b"LBLSIZE")
    label = content[: max(label_bytes, 0)]
    rows, columns = _label_number(path, label, b"NR"), _label_number(path, label, b"NC")
    first, count = (
        (label_bytes + 4 * RESLOC_INTEGERS, columns - RESLOC_INTEGERS) if rows == 1 else (label_bytes, 4 * rows)
    )
    body = content[first : first + 4 * count]
    if len(body) != 4 * count or count <= 0 or (rows > 1 and columns != 4):
        raise _refused(path, f"its label promises {rows} rows of {columns} columns that are not there")
    values = np.asarray(vax.from_vax32(body), dtype=np.float64)
    return values.reshape(-1, 2 if rows == 1 else 4)


def _label_number(path: Path, label: bytes, key: bytes) -> int:
    match = re.search(rb"(?<![A-Z0-9_])" + key + rb"=(\d{1,7})(?!\d)", label)
    if not match:
        raise _refused(path, f"its label lacks {key.decode()}")
    return int(match.group(1))


def _refused(path: Path, fault: str) -> RefusedError:
    return RefusedError(Reason.RESEAU_TABLE_UNREADABLE, f"reseau table {path}: {fault}.", REMEDY)
