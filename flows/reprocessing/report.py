"""What Prefect is told about a run: artifacts for its pages, an event for its automations."""

import logging
import math
import time
from typing import Any
from uuid import UUID

from flows.prefect_settings import server_is_lost
from flows.reprocessing.outcomes import Outcome, all_outcomes
from flows.reprocessing.run import Run
from flows.reprocessing.tally import STATUSES, in_words
from flows.verdict import PUBLISHED

Summary = dict[str, Any]
FINISHED, TOO_MANY = "planetpose.reprocess.finished", "planetpose.reprocess.too-many-failed"
TELL_EVERY_S = 10.0
LISTED, PICTURES = 500, 6
logger = logging.getLogger("planetpose")


def publish_report(run: Run, summary: Summary) -> None:
    """Make the artifacts and emit the events of a run; a server that is lost meanwhile is no failure of the run."""
    import httpx
    from prefect.events import emit_event
    from prefect.exceptions import PrefectException

    if server_is_lost():  # Prefect would try for half a minute
        logger.warning("Prefect's server is lost: it has no artifacts and events of this run")
        return
    try:
        make_artifacts(run, summary)
    except (httpx.HTTPError, PrefectException, OSError) as error:
        logger.warning("Prefect has no artifacts of this run: %s: %s", type(error).__name__, error)
        return
    resource = {"prefect.resource.id": f"planetpose.store.{run.settings.store.name}"}
    emit_event(FINISHED, resource, payload=summary)
    if run.too_many_failed:
        emit_event(TOO_MANY, resource, payload=summary)


def make_artifacts(run: Run, summary: Summary) -> None:
    """A table of the run and a few of its overlays."""
    from prefect.artifacts import create_markdown_artifact, create_table_artifact

    key = key_of(run)
    create_table_artifact(key=key, table=table_of(run), description=in_words(summary))
    create_markdown_artifact(key=f"{key}-overlays", markdown=pictures_of(run), description="Overlays")


class ProgressBar:
    """How far a run is, on Prefect's pages; told no oftener than every `TELL_EVERY_S`, and no more once that fails."""

    def __init__(self, run: Run) -> None:
        self._key = f"{key_of(run)}-progress"
        self._images = len(run.requests)
        self._id: UUID | None = None
        self._next_s = 0.0

    def show(self, ended: int, last: bool = False) -> None:
        """So many images have ended, or need not be done. last: no more will be told, so this is."""
        import httpx
        from prefect.artifacts import create_progress_artifact, update_progress_artifact
        from prefect.exceptions import PrefectException

        if time.monotonic() < self._next_s and (not last or self._next_s == math.inf):
            return
        self._next_s = time.monotonic() + TELL_EVERY_S
        percent = 100.0 * ended / max(self._images, 1)
        try:
            if self._id is None:
                found = create_progress_artifact(percent, key=self._key, description=f"{self._images} images")
                self._id = found if isinstance(found, UUID) else None
            else:
                update_progress_artifact(self._id, percent)
        except (httpx.HTTPError, PrefectException, OSError) as error:
            logger.warning("Prefect shows no more progress: %s: %s", type(error).__name__, error)
            self._next_s = math.inf


def key_of(run: Run) -> str:
    """What the artifacts of a store's runs are called."""
    return "reprocess-" + "".join(c if c.isalnum() else "-" for c in run.settings.store.name.lower()).strip("-")


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
        for outcome in all_outcomes(run.settings.books)
        if outcome.run == run.name and outcome.status in PUBLISHED
    ]
    published.sort(key=lambda outcome: -(outcome.limb_rms_px or 0.0))
    shown = [picture for outcome in published[:PICTURES] if (picture := picture_of(run, outcome))]
    return "\n\n".join(shown) or "No image was published in this run."


def picture_of(run: Run, outcome: Outcome) -> str | None:
    """A small overlay with its caption; None when there is none."""
    from tasks.pictures.embedded import overlay_in_markdown

    picture = overlay_in_markdown(run.settings.store / outcome.product)
    if picture is None:
        return None
    rms = "unknown" if outcome.limb_rms_px is None else f"{outcome.limb_rms_px:.2f} px"
    caption = f"**{outcome.product}**: {outcome.status}, limb rms {rms}"
    return f"{caption}\n\n{picture}"
