"""A reprocessing run without the orchestration: its plan, what it leaves in the store. Nothing here knows Prefect."""

import logging
import time
import uuid
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from catalog.digest import digests_to_save, remember_digests
from catalog.errors import FailedError, PlanetposeError
from catalog.settings import default_kernels
from flows.options import BOOKS, ReprocessOptions, absolute
from flows.reprocessing.planners import each_plan
from flows.reprocessing.planning import Plan
from flows.reprocessing.worker import DIGESTS, sweep_claims
from flows.request import Request
from flows.requests import each_request, fetch_missing, listed, requests_of_list
from tasks.atomic import file_put_in_place, sweep_temporaries
from tasks.boundary import PUBLISHED
from tasks.cache import prune, sweep_cache
from tasks.diagnose.failed_folder import FAILED
from tasks.objectstore.places import index_object_store, index_store, place_of
from tasks.objectstore.state import IMAGES, RUNS, TRACES, pull_files, pull_state, push_files
from tasks.outcomes import Outcome, names_of, read_outcome, write_outcome
from tasks.publish.origin import note_place
from tasks.run_tally import Tally, row_of, write_tables

logger = logging.getLogger("planetpose")


@dataclass
class Run:
    """One run. name: unique, sorts by time. why: of every image that was or would be done."""

    options: ReprocessOptions
    name: str
    requests: list[Request]
    tally: Tally
    started: float = field(default_factory=time.time)
    why: dict[str, str] = field(default_factory=dict)

    def plans(self) -> Iterator[Plan]:
        """The plan of every image, in the list's order, made when it is needed."""
        for plan in each_plan(self.requests, len(self.requests), self.options):
            if plan.do:
                self.why[plan.request.product] = plan.why
            yield plan

    def leave(self, plan: Plan) -> None:
        """Count an image that need not be done; its product remembers where it lies now."""
        self.tally.add(plan.last, done=False)
        if plan.last is not None and plan.last.status in PUBLISHED:
            if plan.fingerprint == plan.last.fingerprint is not None:
                return  # the place too is what it was
            note_place(plan.request.product_folder, plan.request.image_place, plan.image)
            self.note_fingerprint(plan, plan.last)

    def note_fingerprint(self, plan: Plan, last: Outcome) -> None:
        """Remember what an unchanged image was found to be made from, so that the next plan is quick."""
        books, product = self.options.books, plan.request.product
        if plan.fingerprint is None or read_outcome(books, product, plan.request.image_place) != last:
            return  # another run did it meanwhile
        with suppress(OSError):
            write_outcome(books, replace(last, fingerprint=plan.fingerprint))

    def outcome_of_this_run(self, product: str) -> Outcome | None:
        """What became of a product of the run since it began, be it by another run at the same time; None when it was
        lost on the way."""
        books, url, image = self.options.books, place_of(self.options.store).publish_to, self.images[product]
        for name in names_of(product, image):
            pull_files(url, books, [f"{IMAGES}/{name}"])
            outcome = read_outcome(books, product, image)
            if outcome and (outcome.run == self.name or outcome.at >= self.began):
                return outcome
        return None

    @cached_property
    def images(self) -> dict[str, Path | str]:
        """The image of every product."""
        return {request.product: request.image_place for request in self.requests}

    @property
    def began(self) -> str:
        """UTC of the run's beginning."""
        return datetime.fromtimestamp(self.started, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")

    @property
    def too_many_failed(self) -> bool:
        """Whether the alarm is to be raised."""
        return self.tally.failed_percent > self.options.most_failed_percent


def begin(options: ReprocessOptions) -> Run:
    """A run, its list read, digests at hand, and the store swept. Raises RefusedError as `requests_of_list`,
    FailedError when the store cannot be written to."""
    options = for_any_folder(options)
    remember_digests(options.steps_cache / DIGESTS)
    if options.fetch:
        fetch_missing(listed(options), options)
    requests = requests_of_list(options)
    pull_state(place_of(options.store).publish_to, options.books)
    try:
        options.books.mkdir(parents=True, exist_ok=True)
        sweep(options.folder, options.steps_cache)
    except OSError as error:
        raise FailedError(
            "store-unwritable", f"store {options.store}: {error}.", "Check the disk and the folder's rights."
        ) from error
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    return Run(options, f"{stamp}-{uuid.uuid4().hex[:6]}", requests, Tally(len(requests)))


def for_any_folder(options: ReprocessOptions) -> ReprocessOptions:
    """The same with kernels that mean the same in every process, as the other paths do from the start."""
    kernels = None if options.kernels is None else tuple(map(absolute, options.kernels))
    return options.model_copy(update={"kernels": kernels})


def sweep(store: Path, cache: Path) -> None:
    """Delete the temporaries and claims of dead processes in a store and in a cache of steps."""
    books = store / BOOKS
    for folder in (store, store / FAILED, books, *(books / name for name in (IMAGES, TRACES, RUNS))):
        if folder.is_dir():
            sweep_temporaries(folder)
    sweep_claims(store)
    sweep_cache(cache)


def planned(options: ReprocessOptions) -> tuple[int, Iterator[Plan]]:
    """How many images a list has, and their plans, each made when it is wanted, for people who want to know beforehand;
    nothing is written. Raises RefusedError as `requests_of_list`."""
    options = for_any_folder(options)
    remember_digests(options.steps_cache / DIGESTS)
    found = listed(options)
    pull_state(place_of(options.store).publish_to, options.books)
    requests = each_request(found, options)
    return len(found.entries), each_plan(requests, len(found.entries), options)


def save_digests() -> None:
    """Keep the digests of unchanged files for the next process."""
    book = digests_to_save()
    if book is None:
        return
    path, text = book
    try:
        with file_put_in_place(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:  # then they are computed again
        logger.warning("%s was not written: %s", path, error)


def finish(run: Run) -> dict[str, Any]:
    """Write the run's tables, bring the index up to date, prune the cache; returns the summary."""
    options = run.options
    save_digests()
    index_store(options.folder)
    index_published(options)
    freed = prune(options.steps_cache, options.cache_limit_gb, options.cache_days)
    summary = {
        "run": run.name,
        "list": options.images,
        "store": str(options.folder),
        "profile": options.profile,
        "workers": options.at_a_time,
        "started": run.began,
        "wall_s": round(time.time() - run.started, 2),
        **run.tally.summary(),
        "too_many_failed": run.too_many_failed,
        "cache_freed_mb": round(freed / 1e6, 1),
        "parameters": parameters_of(options),
    }
    try:
        summary["table"] = str(write_tables(options.folder, options.books, run.name, summary, rows_of(run)))
        tables = [f"{RUNS}/{run.name}{end}" for end in (".csv", ".json")]
        push_files(place_of(options.store).publish_to, options.books, tables)
    except (OSError, FailedError) as error:
        logger.error("the table of %s was not written: %s", options.store, error)
    return summary


def parameters_of(options: ReprocessOptions) -> dict[str, Any]:
    """The options as plain JSON, with the kernels that this shell's environment stands for: another one has others."""
    chosen = default_kernels() if options.kernels is None else options.kernels
    kernels = [str(absolute(path)) for path in chosen]
    return options.model_dump(mode="json", exclude={"dry_run"}) | {"kernels": kernels}


def index_published(options: ReprocessOptions) -> None:
    """Bring the index of the object store up to date, if there is one."""
    url = place_of(options.store).publish_to
    if url is None:
        return
    try:
        index_object_store(url)
    except PlanetposeError as error:  # the products are there all the same
        logger.error("the index of %s was not written: %s", url, error)


def rows_of(run: Run) -> Iterator[dict[str, Any]]:
    """The table's lines, read from what is remembered."""
    for request in run.requests:
        product = request.product
        done = product in run.why
        outcome = (
            run.outcome_of_this_run(product) if done else read_outcome(run.options.books, product, request.image_place)
        )
        yield row_of(product, outcome, done, run.why.get(product, "unchanged"))
