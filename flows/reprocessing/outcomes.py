"""What is remembered of every image: one small file in the store, exchanged as a whole.

Whoever did the image writes it, so nothing is lost when flow, server or machine end; two writers know the same.
"""

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from catalog.plain_files import own_json
from catalog.regular_file import read_regular_text
from tasks.atomic import file_put_in_place
from tasks.publish.origin import OTHER_IMAGE

IMAGES = "images"


@dataclass(frozen=True)
class Outcome:
    """How an image ended.

    trace: of its steps, see `flows.trace`. image_sha256: of its file, None when that could not be read. passing: the
    fault may be gone by itself. tries: how many runs ended like this while nothing changed. key: of the
    published product. seconds, cpu_s: by the clock, and of the processor. steps: per step seconds, peak_mb, cached.
    at: UTC of the end. run: the run that did it.
    """

    product: str
    image: str
    status: str
    reason: str | None
    trace: dict[str, Any]
    run: str
    at: str
    image_sha256: str | None = None
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


def outcome_file_of_namesake(books: Path, product: str, image: Path | str) -> Path:
    """Where the outcome of an image is that was refused because the product of its name is another image's, whose own
    outcome stays. No product has a `~` in its name."""
    digest = hashlib.sha256(os.fsencode(os.path.abspath(image))).hexdigest()[:12]
    return books / IMAGES / f"{product}~{digest}.json"


def read_outcome(books: Path, product: str, image: Path | str) -> Outcome | None:
    """The outcome of a product, or of that image of its name which was refused; None when there is none, or it is
    damaged or of another version."""
    return _read(outcome_file_of_namesake(books, product, image)) or _read(outcome_file(books, product))


def _read(path: Path) -> Outcome | None:
    try:
        return Outcome(**own_json(read_regular_text(path)))
    except (OSError, ValueError, TypeError):
        return None


def write_outcome(books: Path, outcome: Outcome) -> None:
    """Exchange the outcome of a product. Raises OSError."""
    text = json.dumps(asdict(outcome), allow_nan=False)
    namesake = outcome_file_of_namesake(books, outcome.product, outcome.image)
    refused = outcome.code == OTHER_IMAGE
    with file_put_in_place(namesake if refused else outcome_file(books, outcome.product)) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    if not refused:
        namesake.unlink(missing_ok=True)


def all_outcomes(books: Path) -> Iterator[Outcome]:
    """Every outcome of a store, by product."""
    for path in sorted((books / IMAGES).glob("[!.]*.json")):
        outcome = _read(path)
        if outcome is not None:
            yield outcome
