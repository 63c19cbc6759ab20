"""The chain of one image: the steps done so far, their records, and who runs the next."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic

from catalog.errors import PlanetposeError
from catalog.spice import KernelLists
from flows.request import Request, refuse_what_is_no_text
from tasks.objectstore.shared import obtain, share
from tasks.record import Record
from tasks.step import AnyStep, F, I, R, Step, StepType

RunStep = Callable[[AnyStep], Record]


class NotCachedError(Exception):
    """A step has no record yet, so the answer cannot be given without working."""

    def __init__(self, step: AnyStep) -> None:
        super().__init__(step.name)
        self.step = step


def only_cached(step: AnyStep) -> Record:
    """A runner that never works. Raises NotCachedError."""
    record = step.record()
    if record is None:
        raise NotCachedError(step)
    return record


@dataclass(frozen=True)
class Done(Generic[R]):
    """A step that was done: the step, its record and the result that the record holds."""

    step: Step[Any, Any, R]
    record: Record
    result: R

    @property
    def key(self) -> str:
        """Key of the step."""
        return self.step.key

    @property
    def folder(self) -> Path:
        """Folder of the record and of the files beside it."""
        return self.step.folder


@dataclass(frozen=True)
class Tried:
    """A step that was to be done, and its record, or how it failed; neither where something else ended it."""

    step: AnyStep
    record: Record | None = None
    failure: PlanetposeError | None = None


class Chain:
    """Steps of one image, in the order of doing.

    run: does a step, or answers from the cache. read_only: nothing is to be written, in the store or elsewhere.
    kernels: as they are offered. done: by the steps' names (`point-2`). tried: all of them, also those that failed or
    were done again otherwise. cached: names of those that were there already.
    """

    def __init__(
        self, request: Request, run: RunStep, read_only: bool = False, kernels: KernelLists | None = None
    ) -> None:
        self.request = request
        self.read_only = read_only
        self.kernels = kernels or KernelLists()
        self.done: dict[str, Done[Any]] = {}
        self.tried: list[Tried] = []
        self.cached: list[str] = []
        self._run = run

    def begin(self) -> None:
        """Refuse what no product could say, and have the files that are at addresses. Raises RefusedError and
        FailedError."""
        refuse_what_is_no_text(self.request)
        if self.request.addresses and not self.read_only:
            self.request.addresses.have(self.request.image)

    def do(
        self,
        kind: StepType[I, F, R],
        inputs: I,
        files: F,
        watched: tuple[tuple[Path, str], ...] = (),
        number: int | None = None,
        destination: Path | None = None,
    ) -> Done[R]:
        """Do a step, in pass `number` if there are several of its kind; see `Step` for the others. Raises what the step
        raises."""
        name = kind.name if number is None else f"{kind.name}-{number}"
        request = self.request
        step = Step(kind, name, request.product, request.cache, inputs, files, destination, watched)
        if not self.read_only:
            obtain(request.shared_cache, step)
        was_there = not self.read_only and step.record() is not None
        record = self._result_of(step)
        if was_there:
            self.cached.append(name)
        elif not self.read_only:
            share(request.shared_cache, step)
        done = Done(step, record, step.result_in(record))
        self.done[name] = done
        return done

    def _result_of(self, step: AnyStep) -> Record:
        tried = Tried(step)
        try:
            tried = replace(tried, record=self._run(step))
        except PlanetposeError as error:
            tried = replace(tried, failure=error)
            raise
        finally:
            self.tried.append(tried)
        if tried.record is None:
            raise TypeError(f"{step.name} has no record")
        return tried.record

    def last(self, kind: StepType[I, F, R]) -> Done[R] | None:
        """The latest step of a kind, None when it was not reached."""
        found = [done for done in self.done.values() if done.step.kind is kind]
        return found[-1] if found else None

    def of_kind(self, kind: StepType[I, F, R]) -> dict[str, R]:
        """Results of all steps of a kind, by their names."""
        return {name: done.result for name, done in self.done.items() if done.step.kind is kind}

    def forget(self, names: Callable[[str], bool]) -> None:
        """Take out steps whose kinds `names` says are to be done again."""
        self.done = {name: done for name, done in self.done.items() if not names(done.step.kind.name)}
