"""The Prefect task: one image. It runs in a thread of the flow's process, or in a Dask worker anywhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from prefect import Task, task
from prefect.cache_policies import NO_CACHE
from prefect.client.schemas.objects import State
from prefect.states import Completed, Failed

from flows.progress import Reporter, Silent
from flows.reprocessing.faults import PassingFaultError
from flows.reprocessing.one_image import InterruptedRunError, Job, do_image
from flows.reprocessing.settings import Limits
from flows.reprocessing.workforce import workforce
from flows.verdict import PUBLISHED


@dataclass(frozen=True)
class Audience:
    """Who in this process hears of progress, and of the run's summary."""

    reporter: Reporter
    on_summary: Callable[[dict[str, Any]], None]


_nobody = Audience(Silent(), lambda _: None)
_audience: ContextVar[Audience | None] = ContextVar("reprocess-audience", default=None)


@contextmanager
def told_to(reporter: Reporter, on_summary: Callable[[dict[str, Any]], None]) -> Iterator[None]:
    """Within the `with` block, flows of this process report to these two."""
    token = _audience.set(Audience(reporter, on_summary))
    try:
        yield
    finally:
        _audience.reset(token)


def audience() -> Audience:
    """Who hears of progress."""
    return _audience.get() or _nobody


def may_pass(_: Any, __: Any, state: State[Any]) -> bool:
    """Whether Prefect is to try an image again."""
    return isinstance(state.data, PassingFaultError)


@task(name="image", task_run_name="{product}", persist_result=False, cache_policy=NO_CACHE)
def image(product: str, job: Job) -> State[None]:
    """Correct one image in a process of this machine. Completed when it is published, else Failed; a fault that may be
    gone the next time is raised as PassingFaultError."""
    # A Dask cluster gets this function by value, and its own module's workers and listeners by name.
    from flows.reprocessing.image_task import perform

    return perform(product, job)


def perform(product: str, job: Job) -> State[None]:
    """What the task does."""
    try:
        outcome = do_image(job, workforce, audience().reporter)
    except InterruptedRunError as error:
        return Failed(message=f"{product}: {error.reason}")
    except OSError as error:  # what it came to could not be written into the store
        raise PassingFaultError(f"{product}: {error}") from error
    if outcome.passing:
        raise PassingFaultError(f"{product}: {outcome.reason}")
    message = f"{product}: {outcome.status}" + (f": {outcome.reason}" if outcome.reason else "")
    return Completed(message=message) if outcome.status in PUBLISHED else Failed(message=message)


def image_task(limits: Limits) -> Task[..., Any]:
    """The task with the retries that the limits allow."""
    return image.with_options(
        retries=limits.retries, retry_delay_seconds=limits.delays_s or 0, retry_condition_fn=may_pass
    )
