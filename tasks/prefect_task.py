"""A cached step as a Prefect task.

Prefect keeps a small pointer beside the record, under the step's own key, so that its caching and its pages show a
finished step as Cached. Its ready-made policies look at arguments or source code and so miss changed helpers, changed
files, and results whose files are gone.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from prefect import Task, task
from prefect.cache_policies import CachePolicy
from prefect.context import TaskRunContext
from prefect.utilities.annotations import quote

from tasks.record import Record
from tasks.registry import STEPS
from tasks.step import AnyStep, run
from tasks.work import Progress

POINTER_FILE = "prefect.json"
KINDS = {step.name: step for step in STEPS}


@dataclass
class PointerIsKey(CachePolicy):
    """The task's parameter `pointer` is its key: a path below the cache folder, which is the result storage."""

    def compute_key(
        self,
        task_ctx: TaskRunContext,  # noqa: ARG002 - Prefect's signature
        inputs: dict[str, Any],
        flow_parameters: dict[str, Any],  # noqa: ARG002
        **kwargs: Any,  # noqa: ARG002
    ) -> str:
        """The value of the parameter."""
        return str(inputs["pointer"])


@task(cache_policy=PointerIsKey(), persist_result=True, result_serializer="json", cache_result_in_memory=False)
def run_step(step: AnyStep, progress: Progress, pointer: str) -> dict[str, str]:  # noqa: ARG001 - pointer is the key
    """Run `step` unless its record exists; what Prefect keeps is only where the record is."""
    run(step, progress)
    return {"step": step.name, "key": step.key, "folder": str(step.folder)}


@cache
def task_of(name: str, cache_folder: Path) -> Task[..., dict[str, str]]:
    """The task of a step's name (`point-2`), which Prefect shows it under. description: what its kind does."""
    kind = KINDS.get(name.partition("-")[0])
    return run_step.with_options(
        name=name,
        description=kind.summary if kind else None,
        task_run_name="{step.name}:{step.product}",
        result_storage=cache_folder,
    )


def run_as_task(step: AnyStep, progress: Progress) -> Record:
    """Like `tasks.step.run`, as a Prefect task of the calling flow. Raises what the step's body raises."""
    pointer = step.cached_at / POINTER_FILE
    if step.record() is None:
        pointer.unlink(missing_ok=True)  # the result is gone: Prefect must not take the step as cached
    task_of(step.name, step.cache)(quote(step), progress, str(pointer.relative_to(step.cache)))
    record = step.record()
    if record is None:
        raise RuntimeError(f"{step.name} of {step.product} ended without a record in {step.folder}")
    return record
