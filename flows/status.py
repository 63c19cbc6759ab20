"""What a store says of itself: how its images ended, its latest runs, where time and memory go, what is out of date."""

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

from pydantic import ValidationError

from catalog.digest import remember_digests
from catalog.errors import PlanetposeError, RefusedError
from catalog.plain_files import own_json
from catalog.spice import KernelLists
from flows.options import BOOKS, ReprocessOptions
from flows.reprocessing.outcomes import Outcome, all_outcomes
from flows.reprocessing.planning import plan_of
from flows.reprocessing.tally import RUNS, STATUSES
from flows.reprocessing.worker import DIGESTS
from flows.requests import requests_of_list
from tasks.boundary import PUBLISHED

Status = dict[str, Any]
SHOWN_RUNS, SHOWN_STEPS, SHOWN_PRODUCTS = 5, 10, 20


def status_of(store: Path, plan: bool = True) -> Status:
    """Plain JSON; keys as in the module's sentence. not_remembered: products that no run made. stale: products of an
    earlier run whose image was refused or failed since; they stay as they are. plan: whether to look what is out of
    date, by list and settings of the latest run. Raises RefusedError when there is no such store."""
    if not store.is_dir():
        raise RefusedError("store-missing", f"there is no store {store}.", "Give the folder that products are in.")
    books = store / BOOKS
    outcomes = list(all_outcomes(books))
    runs = latest_runs(books)
    remembered = {outcome.product for outcome in outcomes}
    published = {outcome.product for outcome in outcomes if outcome.status in PUBLISHED}
    not_published = {outcome.product for outcome in outcomes} - published
    there = products_in(store)
    return {
        "store": str(store),
        "images": len(outcomes),
        "status": {name: sum(outcome.status == name for outcome in outcomes) for name in STATUSES},
        "reasons": reasons_of(outcomes),
        "may_pass": sum(outcome.passing for outcome in outcomes),
        "not_remembered": sorted(there - remembered),
        "stale": sorted(there & not_published),
        "runs": runs,
        "steps": steps_of(outcomes),
        "slowest_images": [
            {"product": o.product, "seconds": o.seconds, "peak_mb": o.peak_mb}
            for o in sorted(outcomes, key=lambda outcome: -outcome.seconds)[:5]
        ],
        "out_of_date": out_of_date(runs[0]) if plan and runs else None,
    }


def reasons_of(outcomes: Iterable[Outcome]) -> dict[str, dict[str, int]]:
    """How many images have which reason, per status, the most frequent first."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for outcome in outcomes:
        if outcome.code:
            counts[outcome.status][outcome.code] += 1
    return {status: dict(counts[status].most_common()) for status in STATUSES if status in counts}


def products_in(store: Path) -> set[str]:
    """Names of the products that are in a store."""
    from tasks.publish.index import product_stamps

    return set(product_stamps(store))


def latest_runs(books: Path) -> list[dict[str, Any]]:
    """Summaries of the latest runs, the newest first."""
    runs = []
    for path in sorted((books / RUNS).glob("[!.]*.json"), reverse=True)[:SHOWN_RUNS]:
        try:
            runs.append(own_json(path.read_text(encoding="utf-8")))
        except (OSError, ValueError):
            continue
    return runs


def steps_of(outcomes: Iterable[Outcome]) -> list[dict[str, Any]]:
    """Per kind of step, the slowest first: how often the images' latest runs did it and found it in the cache, seconds
    of when it was done (median, largest, sum), the largest peak of memory known, and the image that took longest."""
    found: dict[str, list[tuple[float, float, str]]] = defaultdict(list)
    cached: Counter[str] = Counter()
    for outcome in outcomes:
        for name, step in outcome.steps.items():
            kind = name.partition("-")[0]
            cached[kind] += bool(step.get("cached"))
            found[kind].append((step["seconds"], step.get("peak_mb") or 0.0, outcome.product))
    return sorted((step_row(kind, found[kind], cached[kind]) for kind in found), key=lambda row: -row["sum_s"])


def step_row(kind: str, found: list[tuple[float, float, str]], cached: int) -> dict[str, Any]:
    """One line of the table of steps."""
    seconds = [each[0] for each in found]
    return {
        "step": kind,
        "done": len(found) - cached,
        "cached": cached,
        "median_s": round(median(seconds), 3),
        "max_s": max(seconds),
        "sum_s": round(sum(seconds), 2),
        "peak_mb": max(each[1] for each in found),
        "slowest": max(found)[2],
    }


def out_of_date(run: dict[str, Any]) -> dict[str, Any]:
    """What a run like this one would do now: how many images, why, and some of them by name; the fault when list or
    profile cannot be read any more."""
    found: dict[str, Any] = {"list": run.get("list"), "profile": run.get("profile"), "fault": None}
    try:
        options = ReprocessOptions(**run.get("parameters", {}))
        remember_digests(options.steps_cache / DIGESTS)
        kernels = KernelLists()
        plans = [replace(plan_of(each, options, kernels), trace={}, last=None) for each in requests_of_list(options)]
    except (PlanetposeError, ValidationError) as error:
        return found | {"fault": getattr(error, "reason", str(error)), "images": None, "why": {}, "products": []}
    wanted = [plan for plan in plans if plan.do]
    return found | {
        "images": len(wanted),
        "of": len(plans),
        "why": dict(Counter(plan.why for plan in wanted).most_common(SHOWN_STEPS)),
        "products": [plan.request.product for plan in wanted[:SHOWN_PRODUCTS]],
    }
