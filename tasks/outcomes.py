"""What is remembered of every image: a small file in the store, and beside it the trace of its steps; each is exchanged
as a whole.

Whoever did the image writes it, so nothing is lost when flow, server or machine end; two writers know the same. Of
tens of thousands of images only the small files are read to list them; a trace is read where an image is planned.
"""

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from catalog.digest import sha256_of_json
from catalog.plain_files import own_json
from catalog.regular_file import read_regular_text
from tasks.atomic import file_put_in_place
from tasks.fields import Json
from tasks.objectstore.state import IMAGES, TRACES, push_files
from tasks.publish.origin import OTHER_IMAGE, place_of_image


@dataclass(frozen=True)
class Outcome:
    """How an image ended.

    trace: digest of the trace of its steps. image_sha256: of its file, None when that could not be read. passing: the
    fault may be gone by itself. tries: how many runs ended like this while nothing changed. key: of the
    published product. seconds, cpu_s: by the clock, and of the processor. steps: per step seconds, peak_mb, cached.
    at: UTC of the end. run: the run that did it. source: of an image at an address, see `catalog.fetch.remote`.
    fingerprint: of all that a published image was made from, None where that is not known.
    """

    product: str
    image: str
    status: str
    reason: str | None
    run: str
    at: str
    trace: str | None = None
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
    fingerprint: str | None = None
    steps: dict[str, dict[str, Any]] = field(default_factory=dict)
    source: dict[str, Any] | None = None

    @property
    def code(self) -> str | None:
        """The reason's first word."""
        return self.reason.partition(":")[0] if self.reason else None

    @property
    def file_name(self) -> str:
        """Of its file. An image that was refused because the product of its name is another image's has one of its
        own, so that the other's outcome stays; no product has a `~` in its name."""
        return namesake(self.product, self.image) if self.code == OTHER_IMAGE else f"{self.product}.json"


def namesake(product: str, image: Path | str) -> str:
    """Name of the outcome's file of an image whose name is another one's."""
    return f"{product}~{hashlib.sha256(os.fsencode(place_of_image(image))).hexdigest()[:12]}.json"


def names_of(product: str, image: Path | str) -> tuple[str, str]:
    """Names of the files that the outcome of an image may be in."""
    return f"{product}.json", namesake(product, image)


def read_outcome(books: Path, product: str, image: Path | str) -> Outcome | None:
    """The outcome of a product, or of that image of its name which was refused; None when there is none, or it is
    damaged or of another version."""
    return _read(books / IMAGES / namesake(product, image)) or _read(books / IMAGES / f"{product}.json")


def read_trace(books: Path, outcome: Outcome) -> Json:
    """The trace of an image's steps, see `flows.trace`; empty when it is gone, damaged, or another outcome's."""
    try:
        trace = own_json(read_regular_text(books / TRACES / outcome.file_name))
    except (OSError, ValueError):
        return {}
    return trace if isinstance(trace, dict) and sha256_of_json(trace) == outcome.trace else {}


def _read(path: Path) -> Outcome | None:
    try:
        return Outcome(**own_json(read_regular_text(path)))
    except (OSError, ValueError, TypeError):
        return None


def write_outcome(books: Path, outcome: Outcome, trace: Json | None = None, url: str | None = None) -> Outcome:
    """Exchange trace and outcome of a product; the trace comes first, and without its outcome it counts for nothing.
    trace: None keeps the one that is there. url: of the object store that `books` is the copy of. Returns the outcome
    as it was written. Raises OSError, and FailedError where the object store cannot be reached."""
    name = outcome.file_name
    if trace is not None:
        outcome = Outcome(**asdict(outcome) | {"trace": sha256_of_json(trace)})
        _exchange(books / TRACES / name, trace)
    _exchange(books / IMAGES / name, asdict(outcome))
    if outcome.code != OTHER_IMAGE:
        for folder in (IMAGES, TRACES):
            (books / folder / namesake(outcome.product, outcome.image)).unlink(missing_ok=True)
    push_files(url, books, files_of(outcome))
    return outcome


def files_of(outcome: Outcome) -> list[str]:
    """Names, below the books, of the files of an outcome, in the order of writing."""
    return [f"{folder}/{outcome.file_name}" for folder in (TRACES, IMAGES)]


def _exchange(path: Path, content: Json) -> None:
    with file_put_in_place(path) as temporary:
        temporary.write_text(json.dumps(content, allow_nan=False) + "\n", encoding="utf-8")


def all_outcomes(books: Path) -> Iterator[Outcome]:
    """Every outcome of a store, by product, without its trace."""
    folder = str(books / IMAGES)
    try:
        names = sorted(name for name in os.listdir(folder) if name[0] != "." and name.endswith(".json"))
    except OSError:  # no run yet
        return
    for name in names:
        outcome = _read(Path(folder, name))
        if outcome is not None:
            yield outcome
