"""The Prefect task: one image. It runs in a thread of the flow's process, or in a Dask worker anywhere; the image is
done by a process of that machine, and how it ended is written into the store there."""

import json
import logging
import platform
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from prefect import Task, task
from prefect.cache_policies import NO_CACHE
from prefect.client.schemas.objects import State
from prefect.states import Completed, Failed

from catalog.errors import FailedError, PlanetposeError
from catalog.fetch.addresses import with_files_in
from catalog.fetch.remote import image_had
from catalog.lists.location import address_in
from catalog.settings import archive_folder, cache_folder
from catalog.times import now_utc
from flows.flow_run import current_run
from flows.options import BOOKS, ReprocessOptions, processors
from flows.progress import STEPS_LOGGER, Reporter, Silent, audience
from flows.reprocessing.planning import Plan
from flows.reprocessing.pool import LostError, Message, Pool, pool
from flows.reprocessing.worker import DIGESTS, sweep_claims
from flows.request import Request
from flows.runners import THREADS
from tasks.boundary import PUBLISHED
from tasks.fields import Json
from tasks.guidance.prefect_run import note_run
from tasks.objectstore.places import place_of
from tasks.outcomes import Outcome, write_outcome

Job = dict[str, Any]

logger = logging.getLogger("planetpose")
steps_logger = logging.getLogger(STEPS_LOGGER)


class PassingFaultError(Exception):
    """An image ended by a fault that may be gone the next time: Prefect's retries are for these."""


class InterruptedRunError(PlanetposeError):
    """The run was ended while the image was at work; nothing is remembered of it."""


def may_pass(_: Any, __: Any, state: State[Any]) -> bool:
    """Whether Prefect is to try an image again."""
    return isinstance(state.data, PassingFaultError)


@task(name="image", task_run_name="{product}", persist_result=False, cache_policy=NO_CACHE)
def image(product: str, job: str) -> State[None]:
    """Correct one image in a process of this machine. Completed when it is published, else Failed; a fault that may be
    gone the next time is raised as PassingFaultError. job: JSON, for Prefect looks into every part of a dictionary,
    here and on the worker, and Dask hashes them."""
    # A Dask cluster gets this function by value, and its own module's processes and listeners by name.
    from flows.reprocessing.image_task import perform

    return perform(product, job)


def perform(product: str, text: str) -> State[None]:
    """What the task does."""
    job = json.loads(text)
    try:
        outcome = do_image(job, pool, audience().reporter)
    except InterruptedRunError as error:
        return Failed(message=f"{product}: {error.reason}")
    except (OSError, FailedError) as error:  # what it came to could not be written into the store
        raise PassingFaultError(f"{product}: {error}") from error
    note_run(Path(job["request"]["store"]), product, current_run())
    if outcome.passing:
        raise PassingFaultError(f"{product}: {outcome.reason}")
    message = f"{product}: {outcome.status}" + (f": {outcome.reason}" if outcome.reason else "")
    return Completed(message=message) if outcome.status in PUBLISHED else Failed(message=message)


def image_task(options: ReprocessOptions) -> Task[..., Any]:
    """The task with the retries that the options allow."""
    return image.with_options(
        retries=options.retries, retry_delay_seconds=options.delays_s or 0, retry_condition_fn=may_pass
    )


def job_of(plan: Plan, options: ReprocessOptions, run: str) -> Job:
    """All that a process anywhere needs for an image: plain JSON."""
    request, last = plan.request, plan.last
    places = {"store": request.store.absolute(), "image": request.image.absolute(), "cache": request.cache.absolute()}
    return {
        "request": request.model_copy(update=places).model_dump(mode="json", by_alias=True),
        "image_sha256": None if plan.image.startswith("fault: ") else plan.image or None,
        "tries": last.tries if last and last.passing and not plan.changed else 0,
        "cache": str(options.cache) if options.cache and not address_in(options.cache) else None,
        "trace": without_results(plan.trace),
        "fingerprint": plan.fingerprint,
        "image_timeout_s": options.image_timeout_s,
        "image_memory_mb": options.image_memory_mb,
        "digests": str(options.steps_cache / DIGESTS),
        # A process's share of this machine, or the one thread of a Dask worker's.
        "threads": max(processors() // options.at_a_time, 1) if options.runner == THREADS else 1,
        "run": run,
    }


def without_results(trace: Json) -> Json:
    """A trace that says what an image depends on, and nothing of what its steps came to."""
    entries = [{**entry, "result": None, "failure": None} for entry in trace.get("steps", [])]
    return {"profile": trace.get("profile"), "steps": entries}


def do_image(job: Job, processes: Pool, reporter: Reporter | None = None) -> Outcome:
    """The outcome of an image, which is also written to its store. Raises InterruptedRunError when the pool was
    closed meanwhile, OSError when the outcome could not be written."""
    reporter, job = reporter or Silent(), job_here(job)
    url = job["request"].get("publish_to")
    product, store = job["request"]["product"], Path(job["request"]["store"])

    def tell(message: Message) -> None:
        if message["kind"] == "step":
            reporter.message(product, message["step"], message["iteration"], message["text"])
        elif message["kind"] == "done":
            figures = {name: message[name] for name in ("step", "seconds", "peak_mb", "cached")}
            text = "from the cache" if message["cached"] else f"{message['seconds']} s"
            steps_logger.info("%s  %s  %s", product, message["step"], text, extra={"product": product, **figures})
        elif message["kind"] == "log":
            level = logging.getLevelNamesMapping().get(message["level"], logging.WARNING)
            logger.log(level, "%s", message["text"], extra={"product": product})

    try:
        end = processes.do(job, tell)
    except LostError as lost:
        sweep_claims(store)
        if processes.is_closed:
            raise InterruptedRunError("interrupted", "the run was ended.") from lost
        outcome = replace(known_beforehand(job, "failed"), reason=str(lost), passing=True)
        return write_outcome(store / BOOKS, outcome, job["trace"], url)
    return write_outcome(store / BOOKS, outcome_of(job, end), end["trace"], url)


def job_here(job: Job) -> Job:
    """A job with the places of this machine, which may share nothing but the object store with the one that made it."""
    if job["request"].get("publish_to") is None:
        return job
    request = Request.model_validate(job["request"])
    cache = Path(job["cache"]) if job["cache"] else cache_folder().absolute()
    here = request.model_copy(update={"store": place_of(str(request.publish_to)).store.absolute(), "cache": cache})
    plain = with_files_in(here, archive_folder().absolute()).model_dump(mode="json", by_alias=True)
    return {**job, "request": plain, "digests": str(cache / DIGESTS)}


def outcome_of(job: Job, end: Message) -> Outcome:
    """The outcome of an image that a process brought to its end."""
    result, steps = end["result"], end["steps"]
    return replace(
        known_beforehand(job, result["status"]),
        fingerprint=job.get("fingerprint") if result["status"] in PUBLISHED else None,
        peak_mb=max((step["peak_mb"] for step in steps.values() if step.get("peak_mb")), default=None),
        steps=steps,
        **{name: end[name] for name in ("passing", "key", "seconds", "cpu_s")},
        **{name: result[name] for name in ("reason", "utc", "camera", "target", "limb_rms_px")},
    )


def known_beforehand(job: Mapping[str, Any], status: str) -> Outcome:
    """What the job says, how often it ended like this, and what is known of an image at an address."""
    request = job["request"]
    image = Request.model_validate(request)
    had = image_had(str(image.image_place), image.addresses.archive) if image.addresses else None
    return Outcome(
        product=request["product"],
        image=str(image.image_place),
        status=status,
        reason=None,
        image_sha256=had.sha256 if had else job["image_sha256"],
        source=had.model_dump(mode="json") if had else None,
        run=job["run"],
        at=now_utc(),
        tries=job["tries"] + 1,
        host=platform.node(),
        profile=request["profile"]["name"],
    )
