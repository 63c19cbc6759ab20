"""The Prefect flow: reprocess an image list. Only what changed is done, and one failed image never stops the others.

One task per image, which has a process of its own do it; what happens within goes to the store and not to Prefect,
whose database would grow by a dozen runs per image. Few images are handed out ahead, so that memory does not grow with
the list. Prefect gets artifacts for its pages and an event for its automations.
"""

import json
import math
import threading
import time
from contextlib import closing
from queue import SimpleQueue
from typing import Any
from uuid import UUID

import httpx
from prefect import artifacts, get_run_logger
from prefect.client.schemas.objects import State, StateType
from prefect.events import emit_event
from prefect.exceptions import PrefectException
from prefect.futures import PrefectFuture
from prefect.states import Completed

from flows.flow import flow_of
from flows.options import ReprocessOptions
from flows.progress import audience, logger
from flows.reprocessing.image_task import image_task, job_of
from flows.reprocessing.planning import Planned
from flows.reprocessing.pool import pool
from flows.reprocessing.run import Run, begin, finish, planned, save_digests
from flows.runners import task_runner
from local_server.prefect_settings import server_is_lost
from tasks.boundary import PUBLISHED
from tasks.outcomes import Outcome, all_outcomes
from tasks.run_tally import STATUSES, in_words

TOO_MANY_FAILED = "TooManyFailed"
LOST = "outcome-lost: its process was lost, or what it came to could not be written into the store. Run it again."
FINISHED, TOO_MANY = "planetpose.reprocess.finished", "planetpose.reprocess.too-many-failed"
REPORT_EVERY_S = 10.0
LISTED, PICTURES = 500, 6
TROUBLE_OF_PREFECT = (httpx.HTTPError, PrefectException, OSError)
Summary = dict[str, Any]


class TooManyFailedError(Exception):
    """More images of the list failed than the run tolerates; the others are published."""

    def __init__(self, summary: Summary) -> None:
        self.summary = summary
        super().__init__(in_words(summary))


@flow_of(ReprocessOptions)
def reprocess(options: ReprocessOptions) -> State[Summary]:
    """Reprocess an image list. Completed with the run's summary; the state `TooManyFailed`, which is a Failed one, when
    more than `most_failed_percent` of the list is refused or failed."""
    if options.dry_run:
        return dry(options)
    run = begin(options)
    work_through(run)
    summary = finish(run)
    audience().on_result(summary)
    get_run_logger().info("%s: %s", options.images, in_words(summary))
    return final_state(run, summary)


def dry(options: ReprocessOptions) -> State[Summary]:
    """Log what would be done."""
    count, plans = planned(options)
    found, wanted = Planned(), dict[str, str]()
    for plan in plans:
        found.add(plan)
        if plan.do:
            wanted[plan.request.product] = plan.why
            get_run_logger().info("%s: %s", plan.request.product, plan.why)
    return Completed(message=found.in_words(), data={"images": count, "would_do": wanted})


def work_through(run: Run) -> None:
    """Do every image of the run that has to be done, some at a time."""
    options = run.options
    one_image, at_once = image_task(options), options.at_a_time + 1
    free, bar = threading.Semaphore(at_once), ProgressBar(run)
    ended: SimpleQueue[str] = SimpleQueue()
    pool.open()
    # When the run is interrupted the processes are killed at once: the task runner would wait for what they are at.
    with task_runner(options.runner, options.at_a_time) as runner, closing(pool):
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
            job = json.dumps(job_of(plan, options, run.name))
            future = runner.submit(one_image, {"product": product, "job": job})
            future.add_done_callback(Ended(product, ended, free))
        for _ in range(at_once):
            free.acquire()
            note(run, ended)
    bar.show(run.tally.ended, last=True)


def note(run: Run, ended: "SimpleQueue[str]") -> None:
    """Count and report the images that have ended."""
    products = [ended.get() for _ in range(ended.qsize())]
    run.pull(products)
    for product in products:
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


def publish_report(run: Run, summary: Summary) -> None:
    """Make the artifacts and emit the events of a run; a server that is lost meanwhile is no failure of the run."""
    if server_is_lost():  # Prefect would try for half a minute
        logger.warning("Prefect's server is lost: it has no artifacts and events of this run")
        return
    try:
        make_artifacts(run, summary)
    except TROUBLE_OF_PREFECT as error:
        logger.warning("Prefect has no artifacts of this run: %s: %s", type(error).__name__, error)
        return
    resource = {"prefect.resource.id": f"planetpose.store.{run.options.folder.name}"}
    emit_event(FINISHED, resource, payload=summary)
    if run.too_many_failed:
        emit_event(TOO_MANY, resource, payload=summary)


def make_artifacts(run: Run, summary: Summary) -> None:
    """A table of the run and a few of its overlays."""
    key = key_of(run)
    artifacts.create_table_artifact(key=key, table=table_of(run), description=in_words(summary))
    artifacts.create_markdown_artifact(key=f"{key}-overlays", markdown=pictures_of(run), description="Overlays")


class ProgressBar:
    """How far a run is, on Prefect's pages; updated at most every `REPORT_EVERY_S`, and no more once that fails."""

    def __init__(self, run: Run) -> None:
        self._key = f"{key_of(run)}-progress"
        self._images = len(run.requests)
        self._id: UUID | None = None
        self._next_s = 0.0

    def show(self, ended: int, last: bool = False) -> None:
        """So many images have ended, or need not be done. last: no more will be shown, so this is."""

        if time.monotonic() < self._next_s and (not last or self._next_s == math.inf):
            return
        self._next_s = time.monotonic() + REPORT_EVERY_S
        percent = 100.0 * ended / max(self._images, 1)
        try:
            if self._id is None:
                found = artifacts.create_progress_artifact(percent, key=self._key, description=f"{self._images} images")
                self._id = found if isinstance(found, UUID) else None
            else:
                artifacts.update_progress_artifact(self._id, percent)
        except TROUBLE_OF_PREFECT as error:
            logger.warning("Prefect shows no more progress: %s: %s", type(error).__name__, error)
            self._next_s = math.inf


def key_of(run: Run) -> str:
    """What the artifacts of a store's runs are called."""
    return "reprocess-" + "".join(c if c.isalnum() else "-" for c in run.options.folder.name.lower()).strip("-")


def table_of(run: Run) -> list[dict[str, Any]]:
    """Counts per status and reason, then what was done in this run, what is not published first; no more than
    `LISTED` images, the whole table is in the store."""
    tally = run.tally
    counts: list[dict[str, Any]] = [
        {"product": f"({status})", "status": tally.status[status], "reason": ""} for status in STATUSES
    ]
    counts += [{"product": f"({code})", "status": count, "reason": ""} for code, count in tally.codes.most_common()]
    done = [outcome for product in run.why if (outcome := run.outcome_of_this_run(product))][: 10 * LISTED]
    done.sort(key=lambda outcome: (outcome.status in PUBLISHED, outcome.product))
    names = ("product", "status", "reason", "seconds")
    return counts + [{name: getattr(outcome, name) or "" for name in names} for outcome in done[:LISTED]]


def pictures_of(run: Run) -> str:
    """Overlays of a few images of the run, the worst limbs first, as markdown that needs no other file."""
    published = [
        outcome
        for outcome in all_outcomes(run.options.books)
        if outcome.run == run.name and outcome.status in PUBLISHED
    ]
    published.sort(key=lambda outcome: -(outcome.limb_rms_px or 0.0))
    shown = [picture for outcome in published[:PICTURES] if (picture := picture_of(run, outcome))]
    return "\n\n".join(shown) or "No image was published in this run."


def picture_of(run: Run, outcome: Outcome) -> str | None:
    """A small overlay with its caption; None when there is none."""
    from tasks.pictures.embedded import overlay_in_markdown

    picture = overlay_in_markdown(run.options.folder / outcome.product)
    if picture is None:
        return None
    rms = "unknown" if outcome.limb_rms_px is None else f"{outcome.limb_rms_px:.2f} px"
    caption = f"**{outcome.product}**: {outcome.status}, limb rms {rms}"
    return f"{caption}\n\n{picture}"
