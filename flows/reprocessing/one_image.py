"""Have one image done by a worker process, and remember how it ended."""

import logging
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from catalog.errors import PlanetposeError
from catalog.times import now_utc
from flows.progress import Reporter, Silent
from flows.reprocessing.claims import sweep_claims
from flows.reprocessing.outcomes import Outcome, read_outcome, write_outcome
from flows.reprocessing.planning import Plan
from flows.reprocessing.settings import BOOKS, Limits, Settings, processors
from flows.reprocessing.workforce import Workforce
from flows.reprocessing.workman import LostError, Message
from flows.runners import THREADS
from tasks.fields import Json

Job = dict[str, Any]
DIGESTS = "digests.json"
STEPS_LOGGER = "planetpose-steps"  # a tree of its own: Prefect would keep a row for every step
logger = logging.getLogger("planetpose")
steps_logger = logging.getLogger(STEPS_LOGGER)


class InterruptedRunError(PlanetposeError):
    """The run was ended while the image was at work; nothing is remembered of it."""


def job_of(plan: Plan, settings: Settings, run: str) -> Job:
    """All that a worker anywhere needs for an image: plain JSON."""
    request = plan.request
    places = {"store": request.store.absolute(), "image": request.image.absolute(), "cache": request.cache.absolute()}
    return {
        "request": request.model_copy(update=places).model_dump(mode="json", by_alias=True),
        "image_sha256": None if plan.image.startswith("fault: ") else plan.image,
        "changed": plan.changed,
        "trace": without_results(plan.trace),
        "limits": settings.limits.model_dump(),
        "digests": str(settings.cache.absolute() / DIGESTS),
        "threads": threads_of(settings),
        "run": run,
    }


def without_results(trace: Json) -> Json:
    """A trace that says what an image depends on, and nothing of what its steps came to."""
    entries = [{**entry, "result": None, "failure": None} for entry in trace.get("steps", [])]
    return {"profile": trace.get("profile"), "steps": entries}


def threads_of(settings: Settings) -> int:
    """Threads that the process of one image may use: its share of this machine, or the one of a Dask worker's."""
    return max(processors() // settings.at_a_time, 1) if settings.runner == THREADS else 1


def do_image(job: Job, workforce: Workforce, reporter: Reporter | None = None) -> Outcome:
    """The outcome of an image, which is also written to its store. Raises InterruptedRunError when the workforce was
    closed meanwhile, OSError when the outcome could not be written."""
    reporter = reporter or Silent()
    product = job["request"]["product"]

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

    limits = Limits.model_validate(job["limits"])
    try:
        outcome = outcome_of(job, workforce.do(job, limits, tell))
    except LostError as lost:
        sweep_claims(Path(job["request"]["store"]))
        if workforce.is_closed:
            raise InterruptedRunError("interrupted", "the run was ended.") from lost
        outcome = outcome_of_lost(job, lost)
    write_outcome(Path(job["request"]["store"]) / BOOKS, outcome)
    return outcome


def outcome_of(job: Job, end: Message) -> Outcome:
    """The outcome of an image that a worker brought to its end."""
    result, steps = end["result"], end["steps"]
    peaks = [step["peak_mb"] for step in steps.values() if step.get("peak_mb")]
    return Outcome(
        **known_beforehand(job, result["status"]) | {"trace": end["trace"]},
        reason=result["reason"],
        passing=end["passing"],
        key=end["key"],
        seconds=end["seconds"],
        cpu_s=end["cpu_s"],
        peak_mb=max(peaks, default=None),
        utc=result["utc"],
        camera=result["camera"],
        target=result["target"],
        limb_rms_px=result["limb_rms_px"],
        steps=steps,
    )


def outcome_of_lost(job: Job, lost: LostError) -> Outcome:
    """The outcome of an image whose worker was killed or died."""
    return Outcome(**known_beforehand(job, "failed"), reason=str(lost), passing=True)


def known_beforehand(job: Mapping[str, Any], status: str) -> dict[str, Any]:
    """What the job says, and how often it ended like this."""
    request = job["request"]
    last = read_outcome(Path(request["store"]) / BOOKS, request["product"], request["image"])
    same = last is not None and last.passing and not job["changed"] and last.run != job["run"]
    return {
        "product": request["product"],
        "image": request["image"],
        "status": status,
        "trace": job["trace"],
        "image_sha256": job["image_sha256"],
        "run": job["run"],
        "at": now_utc(),
        "tries": last.tries + 1 if last and same else last.tries if last and last.run == job["run"] else 1,
        "host": platform.node(),
        "profile": request["profile"]["name"],
    }
