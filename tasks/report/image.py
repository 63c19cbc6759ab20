"""One image of the report: its pictures and its page, made anew when they would show something else than before."""

import hashlib
import html
import json
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from tasks.boundary import reason_of, trouble_of
from tasks.code_version import code_version
from tasks.publish.contained import refuse_what_is_elsewhere
from tasks.publish.index_rows import UNREADABLE
from tasks.report.page import image_page
from tasks.report.pictures import drawn, heading_and_caption, last_change
from tasks.report.product import ImageEntry, image_entry

PAGES, PICTURES = "images", "pictures"
MADE = re.compile(rb'<meta name="planetpose-made" content="([^"]*)">')
HEAD_BYTES = 4096


@dataclass(frozen=True)
class Job:
    """What a page is made of. row: of the index. neighbours: products before and after it."""

    store: Path
    out: Path
    row: dict[str, Any]
    kinds: tuple[str, ...]
    neighbours: tuple[str | None, str | None]
    head: dict[str, Any]

    @property
    def product(self) -> str:
        """Name of the product."""
        return str(self.row["product"])

    @property
    def page(self) -> Path:
        """The page's file."""
        return self.out / PAGES / f"{self.product}.html"

    @property
    def pictures_key(self) -> str:
        """Of what the pictures show."""
        return digest_of_all(self.row["stamp"], code_version("tasks.report.pictures"))

    @property
    def page_key(self) -> str:
        """Of what the page says."""
        shown = (sorted(self.row.items()), self.kinds, self.neighbours, self.head["store"])
        return digest_of_all(self.pictures_key, *shown, page_version())


@dataclass(frozen=True)
class Made:
    """What became of an image: its verdict and why, its thumbnail, pictures that could not be drawn and why."""

    product: str
    status: str
    reason: str
    thumbnail: str | None
    missing: dict[str, str] = field(default_factory=dict)


def unchanged(job: Job) -> Made | None:
    """The image as an earlier report shows it; None when the page would be another, or a picture is gone. What could
    not be drawn is tried again."""
    known = made_of(job.page)
    if known.get("page") != job.page_key or not pictures_are_there(job, known):
        return None
    if trouble_of(lambda: refuse_what_is_elsewhere(job.store / job.product), job.product) is not None:
        return None
    return Made(job.product, str(job.row["status"]), ImageEntry(job.product, job.row).reason, known.get("thumbnail"))


def pictures_are_there(job: Job, known: dict[str, Any]) -> bool:
    """Whether the pictures that a page names are there and younger than the product."""
    try:
        published = last_change(job.store / job.product)
        files = [os.stat(job.out / PICTURES / name) for name in known.get("files", [])]
    except (OSError, ValueError, TypeError):
        return False
    return all(file.st_mtime > published for file in files)


def make_image(job: Job) -> Made:
    """Draw the pictures, unless an earlier report has the same, and write the page."""
    known = made_of(job.page)
    same = known.get("pictures") == job.pictures_key and pictures_are_there(job, known)
    entry = entry_of(job, set(known["files"]) if same else set())
    complete = not entry.missing and entry.status != UNREADABLE
    files = [name for name, _, _ in entry.pictures] + ([entry.thumbnail] if entry.thumbnail else [])
    made = {"page": job.page_key, "pictures": job.pictures_key, "files": files, "thumbnail": entry.thumbnail}
    text = image_page(entry, job.head, PICTURES, job.neighbours, json.dumps(made) if complete else "")
    temporary = job.page.with_name(f".{job.page.name}.{os.getpid()}")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(job.page)  # a page is whole, or an earlier one
    return Made(entry.product, entry.status, entry.reason, entry.thumbnail, entry.missing)


def entry_of(job: Job, there: set[str]) -> ImageEntry:
    """What the report says of one image, its pictures drawn; of a product that is broken, why. there: pictures that are
    drawn already."""
    folder = job.store / job.product
    broken = ImageEntry(folder.name, job.row | {"status": UNREADABLE})
    entries = [broken]

    def gather() -> None:
        refuse_what_is_elsewhere(folder)
        entry = image_entry(folder, job.row)
        if job.row["status"] != UNREADABLE:
            draw_pictures(entry, folder, job, there)
        entries.append(entry)

    error = trouble_of(gather, folder.name)
    if error is not None:
        broken.row["reason"] = reason_of(error)
    return entries[-1]


def draw_pictures(entry: ImageEntry, folder: Path, job: Job, there: set[str]) -> None:
    """Draw an image's pictures; what cannot be drawn is noted in the entry."""
    from tasks.pictures.thumbnail import write_thumbnail

    pictures, product = job.out / PICTURES, entry.product
    small = pictures / f"{product}-small.png"

    def draw_thumbnail() -> None:
        entry.thumbnail = (small if small.name in there else write_thumbnail(folder, small)).name

    def draw(kind: str) -> None:
        known = [pictures / name for name in sorted(there) if name.startswith(f"{product}-{kind}")]
        entry.pictures += [
            (path.name, *heading_and_caption(kind, path.stem))
            for path in known or drawn(kind, folder, pictures, product)
        ]

    drawing: dict[str, Callable[[], None]] = {"thumbnail": draw_thumbnail}
    drawing |= {kind: partial(draw, kind) for kind in job.kinds}
    for kind, work in drawing.items():
        error = trouble_of(work, product)
        if error is not None:
            entry.missing[kind] = reason_of(error)


def made_of(page: Path) -> dict[str, Any]:
    """What a page says that it was made of; nothing where it is none, or another version's."""
    try:
        with page.open("rb") as file:
            found = MADE.search(file.read(HEAD_BYTES))
        known = json.loads(html.unescape(found[1].decode())) if found else {}
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def page_version() -> str:
    """Of the code and templates that pages are made by."""
    templates = [path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.j2"))]
    return digest_of_all(code_version("tasks.report.page"), code_version("tasks.report.product"), *templates)


def digest_of_all(*contents: Any) -> str:
    """Hex digest of values by their texts."""
    return hashlib.sha256(repr(contents).encode()).hexdigest()[:24]


def neighbours_of(products: Sequence[str], position: int) -> tuple[str | None, str | None]:
    """The products before and after one."""
    before = products[position - 1] if position else None
    return before, products[position + 1] if position + 1 < len(products) else None
