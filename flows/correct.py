"""The Prefect flow: correct images, each through the chain of cached tasks; one bad image never stops the others."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from dataclasses import dataclass
from threading import Event

from prefect import flow, get_run_logger
from prefect.states import Completed, Failed, State

from flows.indexing import note_in_index
from flows.one_image import Result, one_result
from flows.plan import twins
from flows.progress import Reporter, Silent
from flows.request import Request
from flows.result import tally
from flows.verdict import PUBLISHED
from tasks.prefect_task import run_as_task

HEAR_CTRL_C_S = 0.5


class ImagesNotOkError(Exception):
    """Some images failed or were refused; the others are published."""


@dataclass(frozen=True)
class Audience:
    """Who in this process hears of progress and results; not a parameter of the flow, for it cannot travel."""

    reporter: Reporter
    on_result: Callable[[Result], None]


_nobody = Audience(Silent(), lambda _: None)
_audience: ContextVar[Audience | None] = ContextVar("audience", default=None)


@contextmanager
def audience(reporter: Reporter, on_result: Callable[[Result], None]) -> Iterator[None]:
    """Within the `with` block, flows of this process report to these two; results come in the order of the requests."""
    token = _audience.set(Audience(reporter, on_result))
    try:
        yield
    finally:
        _audience.reset(token)


@flow(name="correct", persist_result=False)
def correct(requests: list[Request], workers: int = 1) -> State[list[Result]]:
    """Correct every request, `workers` images at a time; the flow fails, after all are done, when one is not ok.

    Images run in threads of this process: the heavy parts (Mitsuba, numpy, OpenCV) release the interpreter's lock.
    """
    listener, run_logger = _audience.get() or _nobody, get_run_logger()
    refused, stop = twins(requests), Event()
    results: list[Result] = []
    with ThreadPoolExecutor(max_workers=max(workers, 1), thread_name_prefix="image") as pool, stopping(pool, stop):
        # Each thread gets a copy of the flow's context: its tasks belong to this flow run.
        futures = [
            pool.submit(
                copy_context().run, one_result, request, listener.reporter, refused.get(position), stop, run_as_task
            )
            for position, request in enumerate(requests)
        ]
        for future in futures:
            result = awaited(future, stop)
            results.append(result)
            note_in_index(requests[len(results) - 1].store, result)
            listener.on_result(result)
            run_logger.info("%s: %s %s", result["product"], result["status"], result["reason"] or "")
    bad = [result for result in results if result["status"] not in PUBLISHED]
    summary = tally(results)
    return Failed(message=summary, data=ImagesNotOkError(summary)) if bad else Completed(message=summary, data=results)


def awaited(future: "Future[Result]", stop: Event) -> Result:
    """The result, once it is there. Waits in short turns: after a rendering Mitsuba gives SIGINT back as one that wakes
    nobody, and Ctrl-C would only be heard at an image's end. Raises KeyboardInterrupt when `stop` is set: then Ctrl-C
    reached the rendering of some image, and perhaps nobody else."""
    while not (future.done() or stop.is_set()):
        wait([future], timeout=HEAR_CTRL_C_S)
    if stop.is_set():
        raise KeyboardInterrupt
    return future.result()


@contextmanager
def stopping(pool: ThreadPoolExecutor, stop: Event) -> Iterator[None]:
    """When the `with` block is interrupted, images at work stop at their next iteration, and others are not begun."""
    try:
        yield
    except BaseException:
        stop.set()
        pool.shutdown(wait=False, cancel_futures=True)
        raise
