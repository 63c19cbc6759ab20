"""Write the report: pictures, one page per image, the index page; nothing is linked but what is in the folder."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalog.times import now_utc
from flows.boundary import reason_of, trouble_of
from flows.report.page import image_page, index_page
from flows.report.product import ImageEntry, image_entry
from tasks.publish.contained import refuse_what_is_elsewhere
from tasks.publish.index import open_index
from tasks.publish.index_rows import UNREADABLE

if TYPE_CHECKING:
    import pandas as pd

INDEX_PAGE, TABLE = "index.html", "images.csv"
PAGES, PICTURES, FIGURES = "images", "pictures", "figures"
KINDS = ("overlay", "residual", "planes", "limb")
USUAL = ("overlay", "residual", "planes")
KEPT = ("residual", "planes")  # slow to draw: pictures younger than their product are not drawn again


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
    figures = _distributions(index, out / FIGURES)
    index.drop(columns=["stamp"]).to_csv(out / TABLE, index=False)
    (out / INDEX_PAGE).write_text(index_page(entries, figures, head), encoding="utf-8")
    broken = {entry.product: entry.reason for entry in entries if entry.status == UNREADABLE}
    return Report(out / INDEX_PAGE, len(entries), missing, broken)


def _entry(folder: Path, row: dict[str, Any], pictures: Path, kinds: Sequence[str]) -> ImageEntry:
    """What is told of one image, its pictures drawn; of a product that is broken, why."""

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
        entry.pictures += [(path.name, *_told(kind, path.stem)) for path in _drawn(kind, folder, pictures, product)]

    drawing: dict[str, Callable[[], None]] = {"thumbnail": draw_thumbnail}
    drawing |= {kind: partial(draw, kind) for kind in kinds}
    for kind, work in drawing.items():
        error = trouble_of(work, product)
        if error is not None:
            entry.missing[kind] = reason_of(error)


def _drawn(kind: str, folder: Path, pictures: Path, product: str) -> list[Path]:
    """Make the pictures of one kind in the folder `pictures`."""
    from shutil import copyfile

    from tasks.pictures.canvas import DRAWING
    from tasks.pictures.product import read_product
    from tasks.publish.names import OVERLAY

    path = pictures / f"{product}-{kind}.png"
    if kind in KEPT and path.is_file() and path.stat().st_mtime > last_change(folder):
        return [path]
    if kind == "overlay":
        copyfile(folder / OVERLAY, path)
        return [path]
    if kind == "limb":
        from tasks.pictures.limb_figures import write_limb_figures
        from tasks.pictures.limb_profiles import compare_limbs

        return list(write_limb_figures(compare_limbs(read_product(folder)), pictures, f"{product}-limb").values())
    from tasks.pictures.planes_figure import planes_figure
    from tasks.pictures.residual_figure import residual_figure

    with DRAWING:
        figure = planes_figure(folder) if kind == "planes" else residual_figure(read_product(folder))
        figure.savefig(path, format="png")
    return [path]


def last_change(folder: Path) -> float:
    """When a product was published, seconds since 1970."""
    from tasks.publish.names import CUBE, RESULT

    parts = (folder, folder / RESULT, folder / CUBE / "zarr.json")
    return max(part.stat().st_mtime for part in parts if part.exists())


CAPTIONS = {
    "overlay": (
        "Limb, grid and terminator",
        "The image with the predicted limb (orange, dashed), the corrected limb (light blue), latitudes and longitudes "
        "every 30 degrees (white) and the terminator (yellow, dotted).",
    ),
    "residual": (
        "Image, simulation, residual",
        "Image, simulation and their difference under the corrected pose, and under the predicted one where its target "
        "is in the picture.",
    ),
    "planes": (
        "Planes of the cube",
        "Latitude, longitude, incidence, emission, phase, resolution, uncertainty of the latitude, and flags.",
    ),
    "limb": ("Lit limb", "Segments across the lit limb, image beside simulation."),
}


def _told(kind: str, stem: str) -> tuple[str, str]:
    """Heading and caption."""
    heading, caption = CAPTIONS[kind]
    return (f"{heading}: {stem.rpartition('-')[2]}", caption) if kind == "limb" else (heading, caption)


def _distributions(index: "pd.DataFrame", folder: Path) -> list[dict[str, Any]]:
    """Draw the figures of all images together."""
    from tasks.pictures.canvas import DRAWING
    from tasks.pictures.store_figures import QUANTITIES, distribution_figure, told

    readable = index[index["status"] != UNREADABLE]
    made = []
    for quantity in QUANTITIES:
        with DRAWING:
            figure = distribution_figure(readable, quantity)
            if figure is None:
                continue
            path = folder / f"{quantity.name}.png"
            figure.savefig(path, format="png")
        rows = told(readable, quantity)
        made.append(
            {
                "file": f"{FIGURES}/{path.name}",
                "label": quantity.label,
                "meaning": quantity.meaning,
                "rows": rows,
                "digits": quantity.digits,
            }
        )
    return made
