"""What a finished step leaves behind: a folder with `record.json` and the arrays or files that the step wrote.

A folder appears whole or not at all: it is filled under a hidden temporary name and renamed. Who comes second to the
same folder throws his own away; both hold the same result.
"""

import json
import os
import shutil
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

RECORD_FILE = "record.json"
TEMPORARY_SUFFIX = ".tmp"
ABANDONED_AFTER_S = 24 * 3600.0


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
    return Record(**json.loads((folder / RECORD_FILE).read_text(encoding="utf-8")))


def read_record(folder: Path, key: str) -> Record | None:
    """The record in `folder` if it is whole and carries `key`, else None."""
    try:
        record = record_in(folder)
    except (OSError, ValueError, TypeError):
        return None
    return record if record.key == key else None


def write_record(folder: Path, record: Record) -> None:
    """Write `record` into `folder`. Raises TypeError or ValueError when its result is not plain, finite JSON."""
    text = json.dumps(asdict(record), indent=1, allow_nan=False)
    (folder / RECORD_FILE).write_text(text + "\n", encoding="utf-8")


@contextmanager
def folder_that_appears_whole(folder: Path, replace: bool = False) -> Iterator[Path]:
    """Yield an empty temporary folder that becomes `folder` at the end of the `with` block, unless it raises.

    If `folder` came into being meanwhile it stays (replace=False) or is exchanged (replace=True).
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    sweep_abandoned(folder.parent)
    temporary = folder.parent / f".{folder.name}.{uuid.uuid4().hex}{TEMPORARY_SUFFIX}"
    temporary.mkdir()
    try:
        yield temporary
        _put_in_place(temporary, folder, replace)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _put_in_place(temporary: Path, folder: Path, replace: bool) -> None:
    if replace and folder.exists():
        _move_aside(folder)
    try:
        temporary.rename(folder)
    except OSError:
        if not folder.exists():
            raise


def _move_aside(folder: Path) -> None:
    """Rename, then delete: a folder on its way out is never seen half-deleted under its own name."""
    aside = folder.parent / f".{folder.name}.{uuid.uuid4().hex}{TEMPORARY_SUFFIX}"
    try:
        folder.rename(aside)
    except FileNotFoundError:
        return
    shutil.rmtree(aside, ignore_errors=True)


def discard(folder: Path) -> None:
    """Delete a step's folder; nothing happens when there is none."""
    _move_aside(folder)


def sweep_abandoned(parent: Path, older_than_s: float = ABANDONED_AFTER_S) -> None:
    """Delete temporary folders that a killed process left in `parent`."""
    oldest = time.time() - older_than_s
    for path in parent.glob(f".*{TEMPORARY_SUFFIX}"):
        try:
            abandoned = path.stat().st_mtime < oldest
        except OSError:
            continue
        if abandoned:
            shutil.rmtree(path, ignore_errors=True)


def size_bytes(folder: Path) -> int:
    """Bytes of all files below `folder`."""
    return sum(os.lstat(os.path.join(place, name)).st_size for place, _, names in os.walk(folder) for name in names)
