"""What a store says of itself: how its images ended, its latest runs, where time and memory go, what is out of date."""

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from catalog.errors import PlanetposeError, RefusedError
from catalog.plain_files import own_json
from catalog.plain_text import printable
from flows.options import BOOKS, ReprocessOptions
from tasks.outcome_counts import OutcomeCounts
from tasks.outcomes import all_outcomes
from tasks.publish.index import product_folders
from tasks.publish.index_rows import stamp_of
from tasks.run_tally import RUNS, STATUSES

Status = dict[str, Any]
SHOWN_RUNS, SHOWN_STEPS = 5, 10
PLANNED_BY_DEFAULT = 10_000  # images whose plans take some five seconds


def status_of(store: Path, plan: bool | None = True) -> Status:
    """Plain JSON; keys as in the module's sentence. not_remembered: products that no run made. stale: products of an
    earlier run whose image was refused or failed since; they stay as they are. plan: whether to look what is out of
    date, by list and settings of the latest run; None: where the images are not very many. Raises RefusedError when
    there is no such store."""
    if not store.is_dir():
        raise RefusedError("store-missing", f"there is no store {store}.", "Give the folder that products are in.")
    books, found = store / BOOKS, OutcomeCounts(STATUSES)
    names = set(product_folders(store))
    for outcome in all_outcomes(books):
        found.add(outcome, outcome.product in names)
        names.discard(outcome.product)
    runs = latest_runs(books)
    if plan is None:
        plan = found.images <= PLANNED_BY_DEFAULT
    return {
        "store": str(store),
        **found.summary(),
        "not_remembered": sorted(printable(name) for name in names if stamp_of(store / name) is not None),
        "runs": runs,
        "out_of_date": out_of_date(runs[0]) if plan and runs else None,
    }


def latest_runs(books: Path) -> list[dict[str, Any]]:
    """Summaries of the latest runs, the newest first."""
    runs = []
    for path in sorted((books / RUNS).glob("[!.]*.json"), reverse=True)[:SHOWN_RUNS]:
        try:
            runs.append(own_json(path.read_text(encoding="utf-8")))
        except (OSError, ValueError):
            continue
    return runs


def out_of_date(run: dict[str, Any]) -> dict[str, Any]:
    """What a run like this one, of the whole list, would do now: how many images, why, some of them by name; the fault
    when list or profile cannot be read any more."""
    from flows.reprocessing.planning import Planned
    from flows.reprocessing.run import planned

    found: dict[str, Any] = {"list": run.get("list"), "profile": run.get("profile"), "fault": None}
    try:
        count, plans = planned(ReprocessOptions(**run.get("parameters", {}) | {"part": None}))
        planned_so_far = Planned()
        for plan in plans:
            planned_so_far.add(plan)
    except (PlanetposeError, ValidationError) as error:
        return found | {"fault": getattr(error, "reason", str(error)), "images": None, "why": {}, "products": []}
    return found | {
        "images": planned_so_far.wanted,
        "of": count,
        "why": dict(planned_so_far.why.most_common(SHOWN_STEPS)),
        "products": planned_so_far.products,
    }
