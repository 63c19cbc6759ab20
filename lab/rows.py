"""Long benchmarks in portions: a line of JSON per case in a file, and what is there is not done again."""

import json
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

Row = dict[str, Any]
Case = TypeVar("Case")


def rows_in_portions(
    cases: Iterable[Case],
    name_of: Callable[[Case], str],
    do: Callable[[Case], Row],
    path: Path | None = None,
    minutes: float | None = None,
) -> Iterator[tuple[Row, bool]]:
    """A row of each case, and whether it was done now, in their order. path: rows are taken from this file by `case`,
    the case's name, and added to it. minutes: no case is begun later than that; what the file has is still given."""
    end = None if minutes is None else time.monotonic() + 60 * minutes
    done = {row["case"]: row for row in read_rows(path)} if path else {}
    for case in cases:
        name = name_of(case)
        if name in done:
            yield done[name], False
        elif end is None or time.monotonic() < end:
            row = {"case": name, **do(case)}
            if path:
                add_row(path, row)
            yield row, True


def add_row(path: Path, row: Row) -> None:
    """One more line."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row, allow_nan=False) + "\n")


def read_rows(path: Path) -> list[Row]:
    """Rows written before; a last line that was cut off is taken out of the file."""
    if not path.is_file():
        return []
    lines = path.read_text(encoding="utf-8").split("\n")
    if lines[-1]:  # the process ended while writing it
        path.write_text("".join(f"{line}\n" for line in lines[:-1]), encoding="utf-8")
    return [json.loads(line) for line in lines[:-1]]
