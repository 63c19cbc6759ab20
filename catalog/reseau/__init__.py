"""Reseau marks engraved in the Voyager vidicons: where each one is nominally seen, and where it really is."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.regular_file import is_regular, read_regular_text

RESEAU_FOLDER = Path(__file__).parent
COLUMNS = ["index", "raw_line", "raw_sample", "object_line", "object_sample"]


@dataclass(frozen=True)
class ReseauTable:
    """raw_xy, object_xy: (n, 2) float64 pixels (x, y), 0-based, of the marks in the raw frame and in undistorted object
    space; index (n,): the marks' numbers in the archive's order."""

    name: str
    index: NDArray[np.int64]
    raw_xy: NDArray[np.float64]
    object_xy: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.index)


def reseau_table_names() -> list[str]:
    """Names of the tables in the catalog."""
    return sorted(path.stem for path in RESEAU_FOLDER.glob("*.tsv"))


def reseau_table_path(name_or_file: str) -> Path | None:
    """File of a table of the catalog, or the user's own file; None for what names neither (`auto`, `nominal` ...)."""
    if name_or_file in reseau_table_names():
        return RESEAU_FOLDER / f"{name_or_file}.tsv"
    return Path(name_or_file) if is_regular(Path(name_or_file)) else None


def find_reseau_table(name_or_file: str) -> ReseauTable:
    """Table by catalog name, or from a tab-separated file with the same columns (1-based lines and samples).

    Raises RefusedError listing the known names, or naming the file and its fault.
    """
    path = reseau_table_path(name_or_file)
    if path is not None:
        return _table_in(path) if path.parent == RESEAU_FOLDER else read_reseau_table(path)
    raise RefusedError(
        Reason.RESEAU_TABLE_UNKNOWN,
        f"reseau table {name_or_file!r} is neither in the catalog nor a file.",
        f"Known are {', '.join(reseau_table_names())}.",
    )


@cache
def _table_in(path: Path) -> ReseauTable:
    return read_reseau_table(path)


def read_reseau_table(path: Path) -> ReseauTable:
    """Read a tab-separated table (columns as in `COLUMNS`, 1-based) into 0-based (x, y) pixels.

    Raises RefusedError when the file cannot be read, lacks a column or holds a value that is no number.
    """
    remedy = f"A reseau table is tab-separated with the columns {', '.join(COLUMNS)}."
    try:
        lines = [line for line in read_regular_text(path).splitlines() if line.strip() and not line.startswith("#")]
        if not lines:
            raise ValueError("it is empty")
        values = np.array([line.split("\t") for line in lines[1:]], dtype=np.float64)
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise RefusedError(Reason.RESEAU_TABLE_UNREADABLE, f"reseau table {path}: {error}.", remedy) from error
    columns_fit = lines[0].split("\t") == COLUMNS and values.ndim == 2 and values.shape[1] == len(COLUMNS)
    if not columns_fit or not np.isfinite(values).all():
        raise RefusedError(Reason.RESEAU_TABLE_INVALID, f"reseau table {path} has other columns or gaps.", remedy)
    return ReseauTable(
        name=path.stem,
        index=values[:, 0].astype(np.int64),
        raw_xy=values[:, [2, 1]] - 1.0,
        object_xy=values[:, [4, 3]] - 1.0,
    )
