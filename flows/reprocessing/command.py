"""Reprocessing from a command line: Prefect is started only when there is something to do."""

import logging
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from catalog.errors import FailedError, PlanetposeError
from flows.prefect_settings import prepare, server_at_hand
from flows.progress import Reporter
from flows.reprocessing.parameters import parameters_of
from flows.reprocessing.run import begin, finish
from flows.reprocessing.settings import Settings
from flows.server import in_use, server_files

Summary = dict[str, Any]
Telling = Callable[[int], AbstractContextManager[Reporter]]
logger = logging.getLogger("planetpose")


def run_reprocess(settings: Settings, server: str, telling: Telling) -> Summary:
    """Do what has to be done and return the run's summary; `telling` is asked for a reporter of so many images.

    Raises RefusedError when list, profile or `only` are no good, FailedError when the store cannot be written to or
    Prefect ended the flow."""
    run, wanted = begin(settings), 0
    for plan in run.plans():
        wanted += plan.do
        run.leave(plan)
    if not wanted:
        return finish(run)
    with telling(wanted) as reporter:
        return run_with_prefect(settings, server, reporter)


def run_with_prefect(settings: Settings, server: str, reporter: Reporter) -> Summary:
    """Run the flow in this process."""
    prepare(server)
    from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

    from flows.reprocess import reprocess
    from flows.reprocessing.image_task import told_to

    heard: list[Summary] = []
    # A flow's heartbeat thread holds up its end by a second; who runs the command sees whether it lives.
    with (
        server_at_hand(server),
        in_use(server_files()),
        temporary_settings({PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}),
        told_to(reporter, heard.append),
    ):
        try:
            state = reprocess(**parameters_of(settings), return_state=True)
        except Exception as error:  # Prefect could not be told how the flow ended; the images are in the store
            if not heard:
                raise
            logger.warning("Prefect does not know of this run: %s: %s", type(error).__name__, error)
            return heard[0]
    if heard:
        return heard[0]
    ended_with = state.result(raise_on_failure=False)
    if isinstance(ended_with, PlanetposeError):
        raise ended_with
    raise FailedError("prefect", f"the flow ended {state.name}: {state.message}.", "Run it again: what is done stays.")
