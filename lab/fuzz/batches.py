"""Batches by the hundred, each with one image that spoils it: is anything lost, hung, or reported without a reason?"""

import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from catalog.children import our_module
from lab.fuzz.batch import Ground, spoil_of
from lab.fuzz.reader_process import ReaderProcess

MEMORY_BYTES = 12_000_000_000  # of addresses; the renderer alone reserves some
TIMEOUT_S = 120.0  # of a whole batch: a machine may be busy, and what hangs does so for ever


@dataclass
class Spoiled:
    """Statuses of the images that spoil their batch, by spoil; bad: every batch with something amiss; slowest_s: of
    those images."""

    by_spoil: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    bad: list[dict[str, Any]] = field(default_factory=list)
    slowest_s: float = 0.0

    def note(self, number: int, answer: dict[str, Any]) -> None:
        """Count one batch."""
        spoil, ended = spoil_of(number), answer["outcome"] == "ended"
        self.by_spoil[spoil][str(answer["status"]) if ended else answer["outcome"]] += 1
        if ended:
            self.slowest_s = max(self.slowest_s, answer["seconds"])
        if not ended or answer["faults"]:
            self.bad.append({"number": number, "spoil": spoil, **answer})

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        counts = {spoil: dict(found) for spoil, found in self.by_spoil.items()}
        total = sum(self.by_spoil.values(), Counter())
        return {
            "batches": total.total(),
            "total": dict(total),
            "by_spoil": counts,
            "slowest_s": self.slowest_s,
            "bad": self.bad,
        }


def spoil_batches(numbers: Iterable[int], seed: int, tell: Callable[[int], None] = lambda _: None) -> Spoiled:
    """Run the batches of these numbers, in a process that is replaced when it hangs or dies."""
    found = Spoiled()
    with tempfile.TemporaryDirectory() as folder:
        ground = Ground(Path(folder))
        ground.prepare()
        command = (*our_module("lab.fuzz.batch_child"), str(ground.folder))
        with ReaderProcess(TIMEOUT_S, MEMORY_BYTES, command) as child:
            for number in numbers:
                found.note(number, child.put([number, seed]))
                tell(number)
    return found


def table(found: Spoiled) -> str:
    """The findings as lines for a person."""
    lines = [
        f"{spoil:32s} " + ", ".join(f"{n} {status}" for status, n in counts.items())
        for spoil, counts in found.by_spoil.items()
    ]
    reported = found.to_dict()
    counts = ", ".join(f"{count} {status}" for status, count in reported["total"].items())
    lines += [
        "",
        f"{reported['batches']} batches: {counts}; slowest {found.slowest_s:.2f} s; {len(found.bad)} bad",
    ]
    for bad in found.bad:
        what = "; ".join(bad.get("faults", [])) or str(bad["reason"])[-600:]
        lines.append(f"BAD batch {bad['number']}, {bad['spoil']}: {bad['outcome']}: {what}")
    return "\n".join(lines)
