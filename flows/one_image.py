"""Correct one image, whoever runs its steps, or answer from the cache; what goes wrong with it becomes its result."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from threading import Event
from typing import Any

from catalog.errors import FailedError, PlanetposeError, RefusedError
from flows.chain import Chain, only_cached
from flows.image import correct_image
from flows.progress import Reporter
from flows.request import Request
from flows.result import result_of
from tasks.boundary import trouble_of
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
    """Run one step and report its begin and its iterations. Raises FailedError once `stop` is set."""

    def progress(_: str, iteration: int, text: str) -> None:
        if stop.is_set():
            raise FailedError("interrupted", "the command was interrupted.", "Run it again: finished steps stay.")
        reporter.message(step.product, step.name, iteration, text)

    progress(step.name, 0, "")
    return run_step(step, progress)


def answer_from_cache(request: Request) -> Result | None:
    """The result of `request` if no step has to be done for it, else None.

    An image that is refused before its first missing step (no such file, unknown camera) is answered too: the steps
    would not change that. Trouble of another kind is left to the flow, which reports it.
    """
    chain = Chain(request, only_cached)
    error = trouble_of(lambda: correct_image(chain), request.product, log=False)
    if error is None or isinstance(error, PlanetposeError):
        return result_of(chain, error)
    return None


def product_twice(fault: str) -> RefusedError:
    """The refusal of an image that would overwrite another one of the same command."""
    return RefusedError("product-twice", f"{fault}.", "Give each a name by --product, or another --store.")


def twins(requests: Sequence[Request]) -> dict[int, str]:
    """Positions of requests whose product folder an earlier request for another image already claims, and the fault."""
    first: dict[Path, Request] = {}
    faults: dict[int, str] = {}
    for position, request in enumerate(requests):
        claimed_by = first.setdefault(request.product_folder.absolute(), request)
        if claimed_by is not request:
            faults[position] = f"{claimed_by.image} and {request.image} would both become {request.product_folder}"
    return faults
