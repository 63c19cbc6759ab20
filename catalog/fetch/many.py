"""Fetch what an image list needs: several files at a time, one failure never stops the others."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from catalog.errors import FailedError
from catalog.fetch import FetchSettings, Item, Outcome, fetch_item, item_of
from catalog.fetch.ledger import Ledger
from catalog.fetch.rate import RateLimit

SAVE_EVERY = 50


def fetch_items(
    items: list[Item], archive: Path, settings: FetchSettings, tell: Callable[[Outcome], None]
) -> list[Outcome]:
    """Outcomes of all items in their order; each is reported as soon as it and those before it are known."""
    archive.mkdir(parents=True, exist_ok=True)
    rate, ledger = RateLimit(settings.requests_per_s), Ledger(archive)
    outcomes: list[Outcome] = []
    pool = ThreadPoolExecutor(settings.workers, "fetch")
    try:
        futures = [pool.submit(fetch_item, item, archive, settings, rate, ledger) for item in items]
        for future in futures:
            outcomes.append(future.result())
            tell(outcomes[-1])
            if len(outcomes) % SAVE_EVERY == 0:
                ledger.save()
    finally:
        pool.shutdown(cancel_futures=True)
        ledger.save()
    return outcomes


def summary_of(outcomes: list[Outcome]) -> dict[str, Any]:
    """Counts, bytes, and what failed."""
    counts = {status: sum(o.status == status for o in outcomes) for status in ("fetched", "present", "failed")}
    return counts | {
        "files": len(outcomes),
        "unchecked": sum(not o.checked and o.status != "failed" for o in outcomes),
        "bytes_fetched": sum(o.bytes or 0 for o in outcomes if o.status == "fetched"),
        "failures": {o.item.location: o.reason for o in outcomes if o.status == "failed"},
    }


def fetched_index(location: str, archive: Path, settings: FetchSettings, mirror: str | None = None) -> Path:
    """The label of a PDS3 index, fetched with its table; the label alone names the table. Raises FailedError when one
    of them could not be had, RefusedError when the label is none."""
    from catalog.lists.pds_index import table_name

    label = _had(item_of(location, mirror), archive, settings)
    _had(item_of(f"{location.rpartition('/')[0]}/{table_name(label)}", mirror), archive, settings)
    return label


def _had(item: Item, archive: Path, settings: FetchSettings) -> Path:
    (outcome,) = fetch_items([item], archive, settings, lambda _: None)
    if outcome.status == "failed":
        raise FailedError("not-fetched", f"{item.location}: {outcome.reason}.", "Check the address, or use --mirror.")
    return archive / item.path
