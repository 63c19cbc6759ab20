"""A cached step: what it is, how its key is made, and how it is run.

The key depends on inputs only, never on the step's result, so it is known before any work; the record on disk is the
only truth about what is done. Nothing here knows Prefect: `tasks.prefect_task` runs the same step as a task.
"""

import time
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

from catalog.digest import refuse_changed, sha256_of_json
from catalog.times import now_utc
from tasks.atomic import folder_put_in_place
from tasks.code_version import code_version
from tasks.record import Record, read_record, write_record
from tasks.work import Progress, Work


@dataclass(frozen=True)
class Step:
    """One step of one image.

    name: unique in the chain (`point-2`). body: module whose `run(work: Work) -> dict` does it and returns plain JSON.
    inputs: plain JSON, all that the result depends on. places: paths, not part of the key. destination: None, or the
    folder that the step publishes (it then is the step's folder, instead of one in the cache). files: path and digest
    of files that the body reads, whose content is part of `inputs`.
    """

    name: str
    body: str
    product: str
    cache: Path
    inputs: dict[str, Any] = field(default_factory=dict)
    places: dict[str, Any] = field(default_factory=dict)
    destination: Path | None = None
    files: tuple[tuple[Path, str], ...] = ()

    @property
    def code(self) -> str:
        """Version of the code that the step runs."""
        return code_version(self.body)

    @cached_property
    def key(self) -> str:
        """Hex digest of everything the result depends on. Raises TypeError when an input is not plain JSON."""
        return sha256_of_json({"step": self.body, "code": self.code, "inputs": self.inputs})

    @property
    def kind(self) -> str:
        """The step's name without its pass: `point` of `point-2`."""
        return self.name.partition("-")[0]

    @property
    def cached_at(self) -> Path:
        """The key's folder in the cache."""
        return self.cache / self.kind / self.key[:2] / self.key

    @property
    def folder(self) -> Path:
        """Where the record and its files are, or will be."""
        return self.destination or self.cached_at

    def record(self) -> Record | None:
        """The finished step's record, or None."""
        return read_record(self.folder, self.key)

    def check_place(self) -> None:
        """Raises RefusedError when what is at the step's place now may not be replaced."""

    def is_done(self) -> bool:
        """Whether what is at the step's place now is the finished step. Raises RefusedError as `check_place`."""
        self.check_place()
        return self.record() is not None


def run(step: Step, progress: Progress) -> Record:
    """The step's record; runs its body only when there is none. Raises what the body raises, leaving nothing behind,
    and RefusedError when one of the step's files changed meanwhile: the result would be kept under the old content."""
    finished = step.record()
    if finished:
        return finished
    # A folder without a readable record is damaged, and one with another key is an older product: both are exchanged.
    # Who comes second with the same key throws his own away: both hold the same result.
    with folder_put_in_place(step.folder, keep=step.is_done) as folder:
        started = time.perf_counter()
        result = import_module(step.body).run(Work(step.inputs, step.places, folder, progress))
        for path, digest in step.files:
            refuse_changed(path, digest, "file")
        seconds = round(time.perf_counter() - started, 4)
        record = Record(step.name, step.key, step.code, step.inputs, result, seconds, now_utc())
        write_record(folder, record)
    return step.record() or record
