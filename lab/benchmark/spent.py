"""Processor seconds and memory of a benchmark's part, and the links that its stores consist of."""

import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from flows.options import BOOKS
from tasks.outcomes import IMAGES, Outcome

MOST_LINKS = 20_000  # of one file; ext4 has at most 65 000


@contextmanager
def processor_seconds() -> Iterator[list[float]]:
    """A list that has the processor seconds of the `with` block when it ends, children included."""
    spent: list[float] = []
    before = _used()
    yield spent
    spent.append(round(_used() - before, 3))


def _used() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def in_a_process(code: str, *arguments: object) -> dict[str, Any]:
    """Run Python code; processor seconds and peak MB of it, its imports included. Raises CalledProcessError."""
    measuring = f"{code}\nfrom flows.reprocessing.worker import peak_mb\nprint(peak_mb())"
    with processor_seconds() as spent:
        command = [sys.executable, "-P", "-c", measuring, *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    return {"seconds": spent[0], "mb": float(done.stdout.split()[-1])}


class Links:
    """Puts hard links of a file, or of a folder's files, in many places: a file system counts at most some ten thousand
    of one file, and then the next is a copy."""

    def __init__(self, source: Path) -> None:
        self._source, self._count = source, 0

    def put(self, place: Path) -> None:
        """Make it appear at `place`."""
        self._count += 1
        as_copy = self._count % MOST_LINKS == 0
        link = shutil.copyfile if as_copy else os.link
        if self._source.is_dir():
            shutil.copytree(self._source, place, copy_function=link)
        else:
            link(self._source, place)
        if as_copy:
            self._source = place


def remembered(store: Path, outcome: Outcome) -> None:
    """Write an outcome, without waiting for the disk."""
    (store / BOOKS / IMAGES / outcome.file_name).write_text(json.dumps(asdict(outcome)))
