"""What is remembered of every image: one small file in the store, exchanged as a whole.

Whoever did the image writes it, so nothing is lost when flow, server or machine end; two writers know the same.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from flows.reprocessing.fingerprint import Fingerprint
from tasks.atomic import file_put_in_place

IMAGES = "images"


@dataclass(frozen=True)
class Outcome:
    """How an image ended.

    passing: the fault may be gone by itself. tries: how many runs ended like this while nothing changed. key: of the
    published product. seconds, cpu_s: by the clock, and of the processor. steps: per step seconds, peak_mb, cached.
    at: UTC of the end. run: the run that did it.
    """

    product: str
    image: str
    status: str
    reason: str | None
    fingerprint: Fingerprint
    run: str
    at: str
    passing: bool = False
    tries: int = 1
    key: str | None = None
    seconds: float = 0.0
    cpu_s: float = 0.0
    peak_mb: float | None = None
    host: str = ""
    utc: str | None = None
    camera: str | None = None
    target: str | None = None
    profile: str | None = None
    limb_rms_px: float | None = None
    steps: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def code(self) -> str | None:
        """The reason's first word."""
        return self.reason.partition(":")[0] if self.reason else None


def outcome_file(books: Path, product: str) -> Path:
    """Where a product's outcome is."""
    return books / IMAGES / f"{product}.json"


def read_outcome(books: Path, product: str) -> Outcome | None:
    """The outcome of a product; None when there is none, or it is damaged or of another version."""
    try:
        return Outcome(**json.loads(outcome_file(books, product).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def write_outcome(books: Path, outcome: Outcome) -> None:
    """Exchange the outcome of a product. Raises OSError."""
    text = json.dumps(asdict(outcome), allow_nan=False)
    with file_put_in_place(outcome_file(books, outcome.product)) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def all_outcomes(books: Path) -> Iterator[Outcome]:
    """Every outcome of a store, by product."""
    for path in sorted((books / IMAGES).glob("[!.]*.json")):
        outcome = read_outcome(books, path.stem)
        if outcome is not None:
            yield outcome
