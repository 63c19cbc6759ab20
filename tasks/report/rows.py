"""The rows of the report's table as files of JavaScript: the page reads those that it shows, and all of them when it
sorts or filters. A page without a server may read no other files than scripts."""

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from tasks.atomic import file_put_in_place

ROWS_PER_FILE = 2000  # some 0.4 MB
FOLDER, FILE = "rows", "rows-{:04d}.js"


def write_rows(out: Path, rows: Iterator[list[Any]]) -> int:
    """Write the rows into files below `out`, and delete those of a longer table; returns how many files there are."""
    folder, number, several = out / FOLDER, 0, list[list[Any]]()
    folder.mkdir(parents=True, exist_ok=True)
    for row in rows:
        several.append(row)
        if len(several) == ROWS_PER_FILE:
            _write(folder, number, several)
            number, several = number + 1, []
    if several or number == 0:
        _write(folder, number, several)
        number += 1
    for path in folder.glob("rows-*.js"):
        if path.name not in {FILE.format(i) for i in range(number)}:
            path.unlink()
    return number


def _write(folder: Path, number: int, rows: Sequence[list[Any]]) -> None:
    text = ",\n".join(json.dumps(row, ensure_ascii=False, separators=(",", ":"), allow_nan=False) for row in rows)
    with file_put_in_place(folder / FILE.format(number)) as temporary:
        temporary.write_text(f"planetposeRows({number}, [\n{text}\n]);\n", encoding="utf-8")


def value_of(value: Any) -> str | float | None:
    """A value of the index as JSON: numbers to eight digits, times as ISO 8601, None where it is unknown."""
    if value is None or str(value) in ("NaT", "<NA>", "nan"):
        return None
    if hasattr(value, "isoformat"):
        return str(value.isoformat())
    if isinstance(value, str):
        return value
    return float(f"{value:.8g}") if math.isfinite(value) else None
