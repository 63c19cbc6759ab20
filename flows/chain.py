"""The chain of one image: the steps done so far, their records, and who runs the next."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from flows.request import Request
from tasks.record import Record
from tasks.step import Step

RunStep = Callable[[Step], Record]


class NotCachedError(Exception):
    """A step has no record yet, so the answer cannot be given without working."""


def only_cached(step: Step) -> Record:
    """A runner that never works. Raises NotCachedError."""
    record = step.record()
    if record is None:
        raise NotCachedError(step.name)
    return record


class Chain:
    """Records of one image's steps, in the order of doing. run: does a step, or answers from the cache."""

    def __init__(self, request: Request, run: RunStep) -> None:
        self.request = request
        self.steps: dict[str, Step] = {}
        self.records: dict[str, Record] = {}
        self.cached: list[str] = []
        self._run = run

    def do(
        self,
        name: str,
        body: str,
        inputs: dict[str, Any],
        places: dict[str, Any],
        destination: Path | None = None,
        kind: type[Step] = Step,
        files: tuple[tuple[Path, str], ...] = (),
    ) -> dict[str, Any]:
        """Do step `name` by the module `body` and return its result. Raises what the step raises."""
        step = kind(name, body, self.request.product, self.request.cache, inputs, places, destination, files)
        self.steps[name] = step
        was_there = step.record() is not None
        self.records[name] = self._run(step)
        if was_there:
            self.cached.append(name)
        return self.records[name].result

    def key(self, name: str) -> str:
        """Key of a step that was done."""
        return self.steps[name].key

    def folder(self, name: str) -> str:
        """Folder of a step that was done."""
        return str(self.steps[name].folder)

    def result(self, name: str) -> dict[str, Any] | None:
        """Result of a step, None when it was not reached."""
        record = self.records.get(name)
        return record.result if record else None
