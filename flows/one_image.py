"""Correct one image, whoever runs its steps; whatever goes wrong with it becomes its result."""

from collections.abc import Callable
from functools import partial
from threading import Event
from typing import Any

from catalog.errors import FailedError
from flows.boundary import trouble_of
from flows.chain import Chain
from flows.image import correct_image
from flows.plan import product_twice
from flows.progress import Reporter
from flows.request import Request
from flows.result import result_of
from tasks.record import Record
from tasks.step import AnyStep, run
from tasks.work import Progress

Result = dict[str, Any]
RunStep = Callable[[AnyStep, Progress], Record]


def one_result(
    request: Request,
    reporter: Reporter,
    twin: str | None = None,
    stop: Event | None = None,
    run_step: RunStep = run,
) -> Result:
    """Correct one image; whatever goes wrong with it becomes its result. run_step: does a step, as a task of the
    calling flow with `tasks.prefect_task.run_as_task`, else without Prefect. stop: set to end the batch; it also is set
    here when Ctrl-C has cut a rendering short."""
    stop = stop or Event()
    chain = Chain(request, partial(run_and_report, reporter, stop, run_step))
    if twin:
        error: Exception | None = product_twice(twin)
    else:
        error = trouble_of(lambda: correct_image(chain), request.product)
    if isinstance(error, FailedError) and error.code == "interrupted":
        stop.set()
    result = result_of(chain, error)
    reporter.finished(request.product, result["status"], result["reason"])
    return result


def run_and_report(reporter: Reporter, stop: Event, run_step: RunStep, step: AnyStep) -> Record:
    """Run one step, telling the reporter that it begins and how it iterates. Raises FailedError once `stop` is set."""

    def progress(_: str, iteration: int, text: str) -> None:
        if stop.is_set():
            raise FailedError("interrupted", "the command was interrupted.", "Run it again: finished steps stay.")
        reporter.message(step.product, step.name, iteration, text)

    progress(step.name, 0, "")
    return run_step(step, progress)
