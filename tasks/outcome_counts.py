"""How the images of a store ended, in counts: by status and reason, with the times of their steps."""

from array import array
from collections import Counter, defaultdict
from collections.abc import Sequence
from heapq import nlargest
from statistics import median
from typing import Any

from tasks.boundary import PUBLISHED
from tasks.outcomes import Outcome

SLOWEST = 5


class OutcomeCounts:
    """What a store's outcomes come to; its
    size does not grow with their number, but for the seconds of steps. statuses: those that are counted."""

    def __init__(self, statuses: Sequence[str]) -> None:
        self._statuses = statuses
        self.images, self.may_pass = 0, 0
        self.status: Counter[str] = Counter()
        self.reasons: dict[str, Counter[str]] = defaultdict(Counter)
        self.stale: list[str] = []
        self.slowest: list[tuple[float, str, float | None]] = []
        self.steps: dict[str, StepTimes] = defaultdict(StepTimes)

    def add(self, outcome: Outcome, has_folder: bool) -> None:
        """Count an image."""
        self.images += 1
        self.may_pass += outcome.passing
        self.status[outcome.status] += 1
        if outcome.code:
            self.reasons[outcome.status][outcome.code] += 1
        if has_folder and outcome.status not in PUBLISHED:
            self.stale.append(outcome.product)
        self.slowest = nlargest(SLOWEST, [*self.slowest, (outcome.seconds, outcome.product, outcome.peak_mb)])
        for name, step in outcome.steps.items():
            self.steps[name.partition("-")[0]].add(step, outcome.product)

    def summary(self) -> dict[str, Any]:
        """Plain JSON; reasons: how many images have which, per status, the most frequent first. steps: per kind, the
        slowest first."""
        reasons = ((name, self.reasons[name]) for name in self._statuses if name in self.reasons)
        rows = [times.row(kind) for kind, times in self.steps.items()]
        return {
            "images": self.images,
            "status": {name: self.status[name] for name in self._statuses},
            "reasons": {name: dict(counts.most_common()) for name, counts in reasons},
            "may_pass": self.may_pass,
            "stale": sorted(self.stale),
            "steps": sorted(rows, key=lambda row: -row["sum_s"]),
            "slowest_images": [{"product": name, "seconds": s, "peak_mb": mb} for s, name, mb in self.slowest],
        }


class StepTimes:
    """How often the images' latest runs did a kind of step and found it in the cache, its seconds when it was done, the
    largest peak of memory known, and the image that took longest."""

    def __init__(self) -> None:
        self.seconds = array("d")
        self.cached, self.peak_mb, self.slowest = 0, 0.0, (-1.0, 0.0, "")

    def add(self, step: dict[str, Any], product: str) -> None:
        """Note a step of an image."""
        peak_mb = step.get("peak_mb") or 0.0
        self.cached += bool(step.get("cached"))
        self.seconds.append(step["seconds"])
        self.peak_mb = max(self.peak_mb, peak_mb)
        self.slowest = max(self.slowest, (step["seconds"], peak_mb, product))

    def row(self, kind: str) -> dict[str, Any]:
        """One line of the table of steps."""
        return {
            "step": kind,
            "done": len(self.seconds) - self.cached,
            "cached": self.cached,
            "median_s": round(median(self.seconds), 3),
            "max_s": max(self.seconds),
            "sum_s": round(sum(self.seconds), 2),
            "peak_mb": self.peak_mb,
            "slowest": self.slowest[2],
        }
