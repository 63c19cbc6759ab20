"""A cached step: what it is, how its key is made, and how it is run.

The key depends on inputs and code only, never on the step's own result, so it is known before any work; the record on
disk is the only truth about what is done. Nothing here knows Prefect: `tasks.prefect_task` runs a step as a task.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar, get_type_hints

from pydantic import BaseModel

from catalog.digest import refuse_changed, sha256_of_json
from catalog.times import now_utc
from tasks.atomic import folder_put_in_place
from tasks.code_version import code_version
from tasks.fields import Content, Json
from tasks.plugin_code import plugins_in
from tasks.record import Record, read_record, write_record
from tasks.work import Progress, Work

I = TypeVar("I", bound=Content)  # noqa: E741 - inputs
F = TypeVar("F")
R = TypeVar("R", bound=Content)
Changed = Literal["pose", "image"]


@dataclass(frozen=True)
class StepType(Generic[I, F, R]):
    """One kind of step, as `tasks.registry` lists it.

    name: also of its folder in the cache, and of its table in a profile. body: does the step; its annotations are the
    types of inputs (all that the result depends on), files (paths, no part of the key) and result. result: the type
    that its record is read as. settings: the model of its table in a profile. changes: what later steps get in place of
    what was there before. parameters: groups of pose parameters that a correction always changes, so that a profile
    which holds one of them leaves it out; empty where it can hold any. labels: inputs in the words of people, by their
    path, for the reason why a step is done again; what earlier steps found is listed there, settings by themselves.
    schema_version: of the result; another one is another key. find_record: looks for the finished
    step elsewhere than in its folder. check_place: raises RefusedError when what is at the step's place may not be
    replaced.
    """

    name: str
    body: Callable[[I, F, Work], R]
    result: type[R]
    settings: type[BaseModel] | None = None
    changes: frozenset[Changed] = frozenset()
    parameters: frozenset[str] = frozenset()
    labels: Mapping[str, str] = field(default_factory=dict)
    schema_version: int = 1
    find_record: "Callable[[Step[I, F, R]], Record | None] | None" = None
    check_place: "Callable[[Step[I, F, R]], None] | None" = None

    @property
    def inputs(self) -> type[I]:
        """Model of its inputs."""
        found: type[I] = get_type_hints(self.body)["inputs"]
        return found

    @property
    def module(self) -> str:
        """Name of the module that holds the body."""
        return self.body.__module__

    @property
    def code(self) -> str:
        """Version of the code that the step runs."""
        return code_version(self.module)

    def code_for(self, inputs: BaseModel) -> str:
        """Version of the code that the step runs, and of the plugins that these inputs name."""
        plugins = plugins_in(inputs)
        return sha256_of_json({"code": self.code, "plugins": plugins})[:16] if plugins else self.code

    @property
    def summary(self) -> str:
        """What it does, in one sentence: the first of its body's documentation."""
        return (self.body.__doc__ or "").strip().partition("\n\n")[0]


def key_of(kind: StepType[Any, Any, Any], code: str, inputs: Json) -> str:
    """Key of a step of this kind: hex digest of its name, its result's schema, its code and its plain inputs. Raises
    TypeError or ValueError when an input is not finite JSON."""
    return sha256_of_json({"step": kind.name, "schema": kind.schema_version, "code": code, "inputs": inputs})


@dataclass(frozen=True)
class Step(Generic[I, F, R]):
    """One step of one image.

    name: unique in the chain (`point-2`). destination: None, or the folder that the step publishes (it then is the
    step's folder, instead of one in the cache). watched: path and digest of files that the body reads, whose content is
    part of `inputs`.
    """

    kind: StepType[I, F, R]
    name: str
    product: str
    cache: Path
    inputs: I
    files: F
    destination: Path | None = None
    watched: tuple[tuple[Path, str], ...] = ()

    @cached_property
    def code(self) -> str:
        """Version of the code that the step runs, and of the plugins that its inputs name."""
        return self.kind.code_for(self.inputs)

    @cached_property
    def plain_inputs(self) -> Json:
        """The inputs as plain JSON."""
        return self.inputs.model_dump(mode="json")

    @cached_property
    def key(self) -> str:
        """Hex digest of everything the result depends on. Raises TypeError or ValueError when an input is not plain,
        finite JSON."""
        return key_of(self.kind, self.code, self.plain_inputs)

    @property
    def cached_at(self) -> Path:
        """The key's folder in the cache."""
        return self.cache / self.kind.name / self.key[:2] / self.key

    @property
    def folder(self) -> Path:
        """Where the record and its files are, or will be."""
        return self.destination or self.cached_at

    def record(self) -> Record | None:
        """The finished step's record, or None."""
        return self.kind.find_record(self) if self.kind.find_record else read_record(self.folder, self.key)

    def is_done(self) -> bool:
        """Whether what is at the step's place now is the finished step. Raises RefusedError when it may not be
        replaced."""
        if self.kind.check_place:
            self.kind.check_place(self)
        return self.record() is not None

    def result_in(self, record: Record) -> R:
        """The result that a record of this step holds."""
        return self.kind.result.model_validate(record.result)


AnyStep = Step[Any, Any, Any]


def run(step: AnyStep, progress: Progress) -> Record:
    """The step's record; runs its body only when there is none. Raises what the body raises, leaving nothing behind,
    and RefusedError when one of the step's files changed meanwhile: the result would be kept under the old content."""
    finished = step.record()
    if finished:
        return finished
    # A folder without a readable record is damaged, and one with another key is an older product: both are exchanged.
    # Who comes second with the same key throws his own away: both hold the same result.
    with folder_put_in_place(step.folder, keep=step.is_done) as folder:
        started = time.perf_counter()
        result = step.kind.body(step.inputs, step.files, Work(folder, progress)).model_dump(mode="json")
        for path, digest in step.watched:
            refuse_changed(path, digest, "file")
        seconds = round(time.perf_counter() - started, 4)
        record = Record(step.name, step.key, step.code, step.plain_inputs, result, seconds, now_utc())
        write_record(folder, record)
    return step.record() or record
