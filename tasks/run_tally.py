"""How a reprocessing run went, in figures and tables."""

import csv
import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from catalog.safe_name import TABLE
from tasks.atomic import file_put_in_place
from tasks.boundary import PUBLISHED
from tasks.objectstore.state import RUNS
from tasks.outcomes import Outcome

STATUSES = (*PUBLISHED, "refused", "failed")
COLUMNS = ("product", "status", "reason", "done", "why", "seconds", "peak_mb", "tries", "camera", "target", "utc")


class Tally:
    """Counts while a run goes on; its size does not grow with the list, but for the names of what was done."""

    def __init__(self, images: int) -> None:
        self.images = images
        self.status: Counter[str] = Counter()
        self.done: Counter[str] = Counter()
        self.codes: Counter[str] = Counter()
        self.steps_done: Counter[str] = Counter()
        self.steps_cached: Counter[str] = Counter()
        self.busy_s = 0.0
        self.cpu_s = 0.0
        self.peak_mb = 0.0

    def add(self, outcome: Outcome | None, done: bool) -> None:
        """Count an image: done in this run, or left as it was."""
        status = outcome.status if outcome else "failed"
        self.status[status] += 1
        if status not in PUBLISHED:
            self.codes[(outcome.code if outcome else None) or "outcome-lost"] += 1
        if not done:
            return
        self.done[status] += 1
        if outcome:
            self.busy_s += outcome.seconds
            self.cpu_s += outcome.cpu_s
            self.peak_mb = max(self.peak_mb, outcome.peak_mb or 0.0)
            for name, step in outcome.steps.items():
                (self.steps_cached if step.get("cached") else self.steps_done)[name.partition("-")[0]] += 1

    @property
    def ended(self) -> int:
        """Images that were seen."""
        return sum(self.status.values())

    @property
    def not_published(self) -> int:
        """Images of the list that have no product."""
        return self.status["refused"] + self.status["failed"]

    @property
    def failed_percent(self) -> float:
        """Of the images that were seen."""
        return 100.0 * self.not_published / max(self.ended, 1)

    def summary(self) -> dict[str, Any]:
        """Plain JSON."""
        return {
            "images": self.images,
            "done": sum(self.done.values()),
            "unchanged": self.ended - sum(self.done.values()),
            "status": {name: self.status[name] for name in STATUSES},
            "done_status": {name: self.done[name] for name in STATUSES},
            "codes": dict(self.codes.most_common()),
            "failed_percent": round(self.failed_percent, 3),
            "steps_done": dict(self.steps_done),
            "steps_cached": dict(self.steps_cached),
            "busy_s": round(self.busy_s, 2),
            "cpu_s": round(self.cpu_s, 2),
            "peak_mb": self.peak_mb,
        }


def in_words(summary: dict[str, Any]) -> str:
    """`57 images: 50 ok, 7 doubtful; 3 done, 54 unchanged`."""
    counts = ", ".join(f"{count} {name}" for name, count in summary["status"].items() if count)
    images = f"{summary['images']} image{'' if summary['images'] == 1 else 's'}"
    return f"{images}: {counts or 'none'}; {summary['done']} done, {summary['unchanged']} unchanged"


def row_of(product: str, outcome: Outcome | None, done: bool, why: str) -> dict[str, Any]:
    """One line of the table."""
    known = {name: getattr(outcome, name) for name in COLUMNS if outcome and name not in ("product", "done", "why")}
    return {"product": product, "status": "failed", "reason": None, **known, "done": done, "why": why}


def write_tables(store: Path, books: Path, run: str, summary: dict[str, Any], rows: Iterable[dict[str, Any]]) -> Path:
    """Write the run's table and summary into the folder `books`, and the same as `reprocess.csv` and `reprocess.json`
    of the store; returns the path of the latter's table."""
    latest = store / f"{TABLE}.csv"
    kept = books / RUNS / f"{run}.csv"
    with file_put_in_place(kept) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    text = json.dumps(summary, indent=1, default=str) + "\n"
    for path, content in (
        (latest, kept.read_text(encoding="utf-8")),
        (kept.with_suffix(".json"), text),
        (latest.with_suffix(".json"), text),
    ):
        with file_put_in_place(path) as temporary:
            temporary.write_text(content, encoding="utf-8")
    return latest
