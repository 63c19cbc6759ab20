"""The report as one HTML page."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lab.paper.section import Cell, Compared, Section

if TYPE_CHECKING:
    from jinja2 import Template

TEMPLATE = Path(__file__).parent / "page.html.j2"
NOTHING = "–"


def page(sections: Sequence[Section], head: dict[str, Any], figures: str) -> str:
    """HTML text; pictures are linked from the folder `figures` beside it, nothing else is."""
    return template().render(sections=sections, head=head, figures=figures)


@cache
def template() -> "Template":
    """The page's template, with the two ways of printing numbers."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"cell": cell, "number": number, "signed": signed}
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8"))


def cell(value: Cell, digits: int) -> str:
    """A table's cell."""
    if value is None:
        return NOTHING
    return f"{value:.{digits}f}" if isinstance(value, float) else str(value)


def number(value: float | None, compared: Compared) -> str:
    """A quantity in its own digits and unit."""
    return NOTHING if value is None else f"{value:.{compared.digits}f} {compared.unit}".strip()


def signed(value: float | None, compared: Compared) -> str:
    """A difference."""
    return NOTHING if value is None else f"{value:+.{compared.digits}f} {compared.unit}".strip()
