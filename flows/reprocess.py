"""The Prefect flow: reprocess an image list. Only what changed is done, and one failed image never stops the others.

One task per image, which has a process of its own do it; what happens within goes to the store and not to Prefect,
whose database would grow by a dozen runs per image. Few images are handed out ahead, so that memory does not grow with
the list.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from typing import Any

from prefect import flow, get_run_logger
from prefect.client.schemas.objects import State, StateType
from prefect.futures import PrefectFuture
from prefect.states import Completed

from flows.defaults import DEFAULT_PROFILE
from flows.reprocessing.image_task import audience, image_task
from flows.reprocessing.one_image import job_of
from flows.reprocessing.parameters import settings_of
from flows.reprocessing.planning import plans_in_words
from flows.reprocessing.report import ProgressBar, publish_report
from flows.reprocessing.run import Run, begin, finish, planned, save_digests
from flows.reprocessing.settings import Settings
from flows.reprocessing.tally import in_words
from flows.reprocessing.workforce import workforce
from flows.runners import task_runner

TOO_MANY_FAILED = "TooManyFailed"
LOST = "outcome-lost: its worker was lost, or what it came to could not be written into the store. Run it again."
Summary = dict[str, Any]


class TooManyFailedError(Exception):
    """More images of the list failed than the run tolerates; the others are published."""

    def __init__(self, summary: Summary) -> None:
        self.summary = summary
        super().__init__(in_words(summary))


@flow(name="reprocess", persist_result=False)
def reprocess(
    images: str,
    store: str,
    profile: str = DEFAULT_PROFILE,
    only: list[str] | None = None,
    kernels: list[str] | None = None,
    workers: int = 0,
    runner: str = "threads",
    image_timeout_s: float = 1800.0,
    image_memory_mb: float = 6000.0,
    retries: int = 2,
    retry_delay_s: float = 10.0,
    force: bool = False,
    again: bool = False,
    verify: bool = False,
    dry_run: bool = False,
    most_failed_percent: float = 5.0,
    fetch: bool = False,
    archive: str | None = None,
    cache: str | None = None,
    cache_limit_gb: float | None = None,
    cache_days: float | None = None,
) -> State[Summary]:
    """Reprocess an image list (see `flows.reprocessing.settings.Settings` for the parameters). Completed with the run's
    summary; the state `TooManyFailed`, which is a Failed one, when more than `most_failed_percent` of the list is
    refused or failed."""
    settings = settings_of(**{name: value for name, value in locals().items() if name != "dry_run"})
    if dry_run:
        return dry(settings)
    run = begin(settings)
    work_through(run)
    summary = finish(run)
    audience().on_summary(summary)
    get_run_logger().info("%s: %s", settings.images, in_words(summary))
    return final_state(run, summary)


def dry(settings: Settings) -> State[Summary]:
    """Tell what would be done."""
    _, plans = planned(settings)
    wanted = {plan.request.product: plan.why for plan in plans if plan.do}
    for product, why in wanted.items():
        get_run_logger().info("%s: %s", product, why)
    summary = {"images": len(plans), "would_do": wanted}
    return Completed(message=plans_in_words(plans), data=summary)


def work_through(run: Run) -> None:
    """Do every image of the run that has to be done, some at a time."""
    settings = run.settings
    one_image, at_once = image_task(settings.limits), settings.at_a_time + 1
    free, bar = threading.Semaphore(at_once), ProgressBar(run)
    ended: SimpleQueue[str] = SimpleQueue()
    with task_runner(settings.runner, settings.at_a_time) as runner, workers_at_hand():
        for plan in run.plans():
            if not plan.do:
                run.leave(plan)
                continue
            if len(run.why) == 1:
                save_digests()  # the workers need not compute them
            free.acquire()
            note(run, ended)
            bar.show(run.tally.ended)
            product = plan.request.product
            future = runner.submit(one_image, {"product": product, "job": job_of(plan, settings, run.name)})
            future.add_done_callback(Ended(product, ended, free))
        for _ in range(at_once):
            free.acquire()
            note(run, ended)
    bar.show(run.tally.ended, last=True)


@contextmanager
def workers_at_hand() -> Iterator[None]:
    """Processes for the images of the `with` block. When it is interrupted they are killed at once: the task runner
    would wait for what they are at."""
    workforce.open()
    try:
        yield
    finally:
        workforce.close()


def note(run: Run, ended: "SimpleQueue[str]") -> None:
    """Count and tell the images that have ended."""
    while not ended.empty():
        product = ended.get()
        outcome = run.outcome_of_this_run(product)
        run.tally.add(outcome, done=True)
        status, reason = (outcome.status, outcome.reason) if outcome else ("failed", LOST)
        audience().reporter.finished(product, status, reason)
        get_run_logger().info("%s: %s %s", product, status, reason or "", extra={"product": product})


class Ended:
    """Notes that a product's task is over, whatever became of it, and lets the next one in."""

    def __init__(self, product: str, ended: "SimpleQueue[str]", free: threading.Semaphore) -> None:
        self._product, self._ended, self._free = product, ended, free

    def __call__(self, _: PrefectFuture[Any]) -> None:
        """Called by the task's future."""
        self._ended.put(self._product)
        self._free.release()


def final_state(run: Run, summary: Summary) -> State[Any]:
    """The state that the run ends in; its message says how the images ended."""
    publish_report(run, summary)
    if run.too_many_failed:
        error = TooManyFailedError(summary)
        return State(type=StateType.FAILED, name=TOO_MANY_FAILED, message=in_words(summary), data=error)
    return Completed(message=in_words(summary), data=summary)
