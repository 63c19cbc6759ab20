"""The report's pages, from the templates beside this module."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tasks.report.product import UNKNOWN, ImageEntry

if TYPE_CHECKING:
    from jinja2 import Environment


FILTER = Path(__file__).with_name("filter.js")  # what fits a filter, in the page and in `planetpose view`


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


def index_page(entries: Sequence[ImageEntry], figures: Sequence[dict[str, Any]], head: dict[str, Any]) -> str:
    """The page with the table of all images and their distributions."""
    verdicts = Counter(entry.status for entry in entries)
    rows = [(entry, [cell(entry.row.get(column.name), column.digits) for column in COLUMNS]) for entry in entries]
    template = environment().get_template("index.html.j2")
    script, names = FILTER.read_text(encoding="utf-8"), ["product", *(column.name for column in COLUMNS)]
    kinds = {"product": "text"} | {column.name: kind_of(column) for column in COLUMNS}
    return template.render(
        columns=COLUMNS,
        rows=rows,
        figures=figures,
        head=head,
        verdicts=verdicts,
        script=script,
        names=names,
        kinds=kinds,
    )


def kind_of(column: Column) -> str:
    """Of a column's values, for filters: text, number or time."""
    return "time" if column.name == "utc" else "text" if column.digits is None else "number"


def image_page(entry: ImageEntry, head: dict[str, Any], pictures: str, neighbours: Sequence[str | None]) -> str:
    """The page of one image; neighbours: products before and after it."""
    template = environment().get_template("image.html.j2")
    return template.render(entry=entry, head=head, pictures=f"../{pictures}", before=neighbours[0], after=neighbours[1])


def cell(value: Any, digits: int | None) -> tuple[str, str]:
    """Text of a cell, and what it is sorted by (empty: unknown)."""
    if value is None or (isinstance(value, float) and math.isnan(value)) or str(value) in ("NaT", "<NA>", "nan"):
        return UNKNOWN, ""
    if digits is not None:
        return f"{value:.{digits}f}", repr(float(value))
    if hasattr(value, "strftime"):
        return value.strftime("%Y-%m-%d %H:%M"), value.isoformat()
    return str(value), str(value)


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
    made.filters["figure_number"] = lambda value, digits: f"{value:.{digits}g}"
    return made
