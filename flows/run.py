"""Run a command that may need Prefect: what can be answered without work is, and Prefect is started only for the
rest."""

import logging
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from typing import Any

from catalog.errors import FailedError, PlanetposeError
from flows.chain import Chain, only_cached
from flows.one_image import answer_from_cache, product_twice, twins
from flows.options import CorrectOptions, ReprocessOptions
from flows.progress import Reporter, reporting_to
from flows.request import Request
from flows.result import result_of
from local_server.prefect_settings import prepare, server_at_hand, server_is_lost
from local_server.server import ServerError, in_use, server_files

Result = dict[str, Any]
Tell = Callable[[Result], None]
logger = logging.getLogger("planetpose")


class InOrder:
    """Passes results on in the order of the requests, each as soon as those before it are there."""

    def __init__(self, count: int, tell: Tell) -> None:
        self._slots: list[Result | None] = [None] * count
        self._passed_on = 0
        self._tell = tell

    def put(self, position: int, result: Result) -> None:
        """The result of the request at `position`."""
        self._slots[position] = result
        while self._passed_on < len(self._slots) and (ready := self._slots[self._passed_on]) is not None:
            self._tell(ready)
            self._passed_on += 1

    @property
    def missing(self) -> list[int]:
        """Positions without a result."""
        return [position for position, result in enumerate(self._slots) if result is None]

    def results(self) -> list[Result]:
        """What is there, in order."""
        return [result for result in self._slots if result is not None]


RunRest = Callable[[list[Request], InOrder, list[int]], None]


def run_requests(
    requests: list[Request],
    server: str,
    workers: int,
    reporter: Reporter,
    tell: Tell,
    run_rest: RunRest | None = None,
    options: CorrectOptions | None = None,
) -> list[Result]:
    """Results of `requests` in their order; `tell` gets each as soon as it and those before it are known.

    server: see `local_server.prefect_settings`. run_rest: does what the cache cannot answer, in place of the flow.
    options: what all the requests are made of, where they are; then the flow is `correct`. Whatever happens, every
    request gets a result.
    """
    run_rest = run_rest or partial(run_with_prefect, server=server, workers=workers, reporter=reporter, options=options)
    ordered = InOrder(len(requests), tell)
    refused = twins(requests)
    for position, request in enumerate(requests):
        answer = refuse_twin(request, refused[position]) if position in refused else answer_from_cache(request)
        if answer is not None:
            reporter.finished(request.product, answer["status"], answer["reason"])
            ordered.put(position, answer)
    pending = ordered.missing
    if pending:
        try:
            run_rest([requests[i] for i in pending], ordered, pending)
        except Exception as error:  # server lost or not to be started: every image still gets its result
            explained = isinstance(error, (ServerError, PlanetposeError, OSError)) or server_is_lost()
            logger.error("the flow ended by %s: %s", type(error).__name__, error, exc_info=not explained)
            for position in ordered.missing:
                ordered.put(position, orchestration_failed(requests[position], error))
    return ordered.results()


def refuse_twin(request: Request, fault: str) -> Result:
    """The result of an image that would overwrite another one of the same command."""
    return result_of(Chain(request, only_cached), product_twice(fault))


def orchestration_failed(request: Request, error: Exception) -> Result:
    """The result of an image that Prefect did not get to."""
    if isinstance(error, PlanetposeError) or (isinstance(error, OSError) and error.filename):
        return result_of(Chain(request, only_cached), error)
    result = result_of(Chain(request, only_cached))
    if isinstance(error, ServerError):  # it says what to do
        return result | {"status": "failed", "reason": f"prefect: {error}"}
    reason = f"prefect: {type(error).__name__}: {error} Try again, or use --server embedded."
    return result | {"status": "failed", "reason": reason}


@contextmanager
def prefect_at_hand(server: str, reporter: Reporter, on_result: Tell) -> Iterator[None]:
    """Within the `with` block flows run in this process with the server that `server` chooses, and report to these
    two."""
    prepare(server)
    from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

    # A flow's heartbeat thread holds up its end by a second; who runs the command sees whether it lives.
    with (
        server_at_hand(server),
        in_use(server_files()),
        temporary_settings({PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}),
        reporting_to(reporter, on_result),
    ):
        yield


def run_with_prefect(
    requests: list[Request],
    ordered: InOrder,
    positions: list[int],
    server: str,
    workers: int,
    reporter: Reporter,
    options: CorrectOptions | None = None,
) -> None:
    """Run the flow in this process and put its results at `positions`."""
    waiting = iter(positions)
    with prefect_at_hand(server, reporter, lambda result: ordered.put(next(waiting), result)):
        from flows.correct import correct, correct_requests

        state = (
            correct_requests(requests, workers, return_state=True)
            if options is None
            else correct(**dict(options.of(positions, workers)), return_state=True)
        )
    if ordered.missing:
        raise RuntimeError(f"the flow ended {state.name}: {state.message}")


def run_reprocess(
    options: ReprocessOptions, server: str, reporter_of: Callable[[int], AbstractContextManager[Reporter]]
) -> Result:
    """Do what has to be done and return the run's summary; `reporter_of` makes a reporter of so many images.

    Raises RefusedError when list, profile or `only` are no good, FailedError when the store cannot be written to or
    Prefect ended the flow."""
    from flows.reprocessing.run import begin, finish

    run, wanted = begin(options), 0
    for plan in run.plans():
        wanted += plan.do
        run.leave(plan)
    if not wanted:
        return finish(run)
    with reporter_of(wanted) as reporter:
        return reprocess_with_prefect(options, server, reporter)


def reprocess_with_prefect(options: ReprocessOptions, server: str, reporter: Reporter) -> Result:
    """Run the flow `reprocess` in this process. Raises as `run_reprocess`."""
    summaries: list[Result] = []
    with prefect_at_hand(server, reporter, summaries.append):
        from flows.reprocess import reprocess

        try:
            state = reprocess(**dict(options), return_state=True)
        except Exception as error:  # Prefect did not hear how the flow ended; the images are in the store
            if not summaries:
                raise
            logger.warning("Prefect does not know of this run: %s: %s", type(error).__name__, error)
            return summaries[0]
    if summaries:
        return summaries[0]
    ended_with = state.result(raise_on_failure=False)
    if isinstance(ended_with, PlanetposeError):
        raise ended_with
    raise FailedError("prefect", f"the flow ended {state.name}: {state.message}.", "Run it again: what is done stays.")
