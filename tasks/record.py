"""What a finished step leaves behind: a folder with `record.json` and the arrays or files that the step wrote."""

import json
import os
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from catalog.regular_file import read_regular_text

RECORD_FILE = "record.json"


@dataclass(frozen=True)
class Record:
    """One step's result and how it came about.

    inputs: all that the result depends on, as it went into `key`. code: version of the step's code. result: plain
    JSON. written: UTC of the end.
    """

    step: str
    key: str
    code: str
    inputs: dict[str, Any]
    result: dict[str, Any]
    seconds: float
    written: str


def record_in(folder: Path) -> Record:
    """The record in `folder`. Raises OSError, ValueError or TypeError when there is none, or none that is whole."""
    return Record(**json.loads(read_regular_text(folder / RECORD_FILE)))


def read_record(folder: Path, key: str) -> Record | None:
    """The record in `folder` if it is whole and carries `key`, else None."""
    try:
        record = record_in(folder)
    except (OSError, ValueError, TypeError):
        return None
    return record if record.key == key else None


def write_record(folder: Path, record: Record, name: str = RECORD_FILE) -> None:
    """Write `record` into `folder`. Raises TypeError or ValueError when its result is not plain, finite JSON."""
    # A line for each field: with `indent` json leaves its fast encoder.
    lines = (f" {json.dumps(f.name)}: {json.dumps(getattr(record, f.name), allow_nan=False)}" for f in fields(record))
    (folder / name).write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def size_bytes(folder: Path) -> int:
    """Bytes of all files below `folder`."""
    return sum(os.lstat(os.path.join(place, name)).st_size for place, _, names in os.walk(folder) for name in names)
