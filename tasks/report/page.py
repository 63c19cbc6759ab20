"""The report's pages, from the templates beside this module."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tasks.report.product import UNKNOWN, ImageEntry
from tasks.report.rows import ROWS_PER_FILE, value_of

if TYPE_CHECKING:
    from jinja2 import Environment


FILTER = Path(__file__).with_name("filter.js")  # what fits a filter, in the page and in `planetpose view`
TABLE = Path(__file__).with_name("table.js")
PAGE_ROWS = 100


@dataclass(frozen=True)
class Column:
    """A column of the table of images: heading, column(s) of the index, digits (None: text)."""

    heading: str
    name: str
    digits: int | None = None


COLUMNS = (
    Column("verdict", "status"),
    Column("camera", "camera"),
    Column("target", "target"),
    Column("UTC", "utc"),
    Column("phase, deg", "phase_deg", 1),
    Column("km/px", "resolution_km", 2),
    Column("radius, px", "radius_px", 0),
    Column("offset x, px", "offset_x_px", 2),
    Column("offset y, px", "offset_y_px", 2),
    Column("range factor", "range_factor", 5),
    Column("turn, deg", "attitude_deg", 2),
    Column("limb rms, px", "limb_rms_px", 3),
    Column("σ x, px", "centre_x_uncertainty_px", 3),
    Column("σ y, px", "centre_y_uncertainty_px", 3),
)


def index_page(
    first: Sequence[list[Any]], verdicts: Counter[str], figures: Sequence[dict[str, Any]], head: dict[str, Any]
) -> str:
    """The page with the table of images and their distributions. first: the rows (`row_of_table`) that it shows at
    first; the others are in files beside it."""
    cells = [[cell(value, column.digits) for value, column in zip(row[3:], COLUMNS, strict=True)] for row in first]
    kinds = {"product": "text", "reason": "text"} | {column.name: kind_of(column) for column in COLUMNS}
    return (
        environment()
        .get_template("index.html.j2")
        .render(
            columns=COLUMNS,
            rows=list(zip(first, cells, strict=True)),
            total=verdicts.total(),
            per_page=PAGE_ROWS,
            per_file=ROWS_PER_FILE,
            figures=figures,
            head=head,
            verdicts=verdicts,
            script=FILTER.read_text(encoding="utf-8") + TABLE.read_text(encoding="utf-8"),
            kinds=kinds,
            described=[{"name": column.name, "digits": column.digits} for column in COLUMNS],
        )
    )


def row_of_table(row: dict[str, Any], thumbnail: str | None, reason: str) -> list[Any]:
    """Product, thumbnail, reason, and the values of the columns."""
    return [row["product"], thumbnail, reason or None, *(value_of(row.get(column.name)) for column in COLUMNS)]


def kind_of(column: Column) -> str:
    """Of a column's values, for filters: text, number or time."""
    return "time" if column.name == "utc" else "text" if column.digits is None else "number"


def image_page(
    entry: ImageEntry, head: dict[str, Any], pictures: str, neighbours: Sequence[str | None], made: str = ""
) -> str:
    """The page of one image; neighbours: products before and after it. made: what it was made of, for later reports."""
    template = environment().get_template("image.html.j2")
    shown = {"pictures": f"../{pictures}", "before": neighbours[0], "after": neighbours[1], "made": made}
    return template.render(entry=entry, head=head, **shown)


def cell(value: str | float | None, digits: int | None) -> str:
    """Text of a cell."""
    if value is None:
        return UNKNOWN
    if digits is not None:
        return f"{value:.{digits}f}"
    return str(value)


@cache
def environment() -> "Environment":
    """The templates, with escaping."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    made = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["minutes"] = lambda text: text[:16].replace("T", " ")
    made.filters["figure_number"] = lambda value, digits: f"{value:.{digits}g}"
    return made
