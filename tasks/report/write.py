"""Write the report: pictures, one page per image, the index page; nothing is linked but what is in the folder."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from catalog.times import now_utc
from tasks.boundary import reason_of, trouble_of
from tasks.publish.contained import refuse_what_is_elsewhere
from tasks.publish.index import open_index
from tasks.publish.index_rows import UNREADABLE
from tasks.report.page import image_page, index_page
from tasks.report.pictures import FIGURES, USUAL, distributions, drawn, heading_and_caption
from tasks.report.product import ImageEntry, image_entry

INDEX_PAGE, TABLE = "index.html", "images.csv"
PAGES, PICTURES = "images", "pictures"


@dataclass(frozen=True)
class Report:
    """page: the index. images: how many have a page; missing: pictures that could not be drawn, and why; broken:
    products that could not be read, and why."""

    page: Path
    images: int
    missing: dict[str, str]
    broken: dict[str, str]


def write_report(
    store: Path, out: Path, kinds: Sequence[str] = USUAL, tell: Callable[[str], None] = lambda _: None
) -> Report:
    """Write the report of `store` into the folder `out`. kinds: which pictures each image gets (`KINDS`). A picture
    that cannot be drawn is explained on the image's page. Raises RefusedError when there is no store."""
    index = open_index(store)
    for name in (PAGES, PICTURES, FIGURES):
        (out / name).mkdir(parents=True, exist_ok=True)
    entries: list[ImageEntry] = []
    missing: dict[str, str] = {}
    for row in index.to_dict("records"):
        tell(str(row["product"]))
        entry = _entry(Path(store) / row["product"], row, out / PICTURES, kinds)
        missing |= {f"{entry.product} {kind}": why for kind, why in entry.missing.items()}
        entries.append(entry)
    head = {"written": now_utc(), "store": Path(store).resolve().name}
    for position, entry in enumerate(entries):
        neighbours = [entries[i].product if 0 <= i < len(entries) else None for i in (position - 1, position + 1)]
        text = image_page(entry, head, PICTURES, neighbours)
        (out / PAGES / f"{entry.product}.html").write_text(text, encoding="utf-8")
    figures = distributions(index, out / FIGURES)
    index.drop(columns=["stamp"]).to_csv(out / TABLE, index=False)
    (out / INDEX_PAGE).write_text(index_page(entries, figures, head), encoding="utf-8")
    broken = {entry.product: entry.reason for entry in entries if entry.status == UNREADABLE}
    return Report(out / INDEX_PAGE, len(entries), missing, broken)


def _entry(folder: Path, row: dict[str, Any], pictures: Path, kinds: Sequence[str]) -> ImageEntry:
    """What the report says of one image, its pictures drawn; of a product that is broken, why."""

    broken = ImageEntry(folder.name, row | {"status": UNREADABLE})
    entries = [broken]

    def tell() -> None:
        refuse_what_is_elsewhere(folder)
        entry = image_entry(folder, row)
        if row["status"] != UNREADABLE:
            _draw(entry, folder.parent, pictures, kinds)
        entries.append(entry)

    error = trouble_of(tell, folder.name)
    if error is not None:
        broken.row["reason"] = reason_of(error)
    return entries[-1]


def _draw(entry: ImageEntry, store: Path, pictures: Path, kinds: Sequence[str]) -> None:
    """Draw an image's pictures; what cannot be drawn is noted in the entry."""
    from tasks.pictures.thumbnail import write_thumbnail

    folder, product = store / entry.product, entry.product

    def draw_thumbnail() -> None:
        entry.thumbnail = write_thumbnail(folder, pictures / f"{product}-small.png").name

    def draw(kind: str) -> None:
        entry.pictures += [
            (path.name, *heading_and_caption(kind, path.stem)) for path in drawn(kind, folder, pictures, product)
        ]

    drawing: dict[str, Callable[[], None]] = {"thumbnail": draw_thumbnail}
    drawing |= {kind: partial(draw, kind) for kind in kinds}
    for kind, work in drawing.items():
        error = trouble_of(work, product)
        if error is not None:
            entry.missing[kind] = reason_of(error)
