"""The report: the parts that were requested, `paper.json`, `index.html` and the figures beside it."""

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from catalog.errors import FailedError, RefusedError
from catalog.reasons import Reason
from catalog.settings import cache_folder, data_folder
from catalog.times import now_utc
from lab.paper.page import page
from lab.paper.section import Context, Part, Section, Tell

JSON_FILE, PAGE_FILE, FIGURES = "paper.json", "index.html", "figures"
REPORT = "report"


@dataclass(frozen=True)
class Report:
    """The sections that were made, and the two files."""

    sections: tuple[Section, ...]
    json_file: Path
    page_file: Path


def write_report(
    out: Path,
    only: Sequence[str] | None = None,
    evaluation: Path | None = None,
    data: Path | None = None,
    cache: Path | None = None,
    tell: Tell = lambda _: None,
) -> Report:
    """Make the parts named in `only` (default: all) and write them into the folder `out`.

    evaluation: a folder written by `planetpose evaluate`. data: real mission files, default PLANETPOSE_DATA's. cache:
    of steps' results, default the user's. A part whose data is missing, or whose work is refused, says so in the
    report and spoils no other. Raises RefusedError for an unknown part.
    """
    names = checked_names(only)
    context = Context(out / FIGURES, cache or cache_folder(), data or data_folder(), evaluation, tell)
    out.mkdir(parents=True, exist_ok=True)
    sections, seconds = [], {}
    for name in names:
        tell(name)
        started = time.perf_counter()
        sections.append(made(name, context))
        seconds[name] = round(time.perf_counter() - started, 2)
    head = {"written": now_utc(), "seconds": seconds, "missing": {s.name: s.missing for s in sections if s.missing}}
    content = {REPORT: head} | {s.name: in_json(s) for s in sections if not s.missing}
    json_file, page_file = out / JSON_FILE, out / PAGE_FILE
    json_file.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    page_file.write_text(page(sections, head, FIGURES), encoding="utf-8")
    return Report(tuple(sections), json_file, page_file)


def checked_names(only: Sequence[str] | None) -> list[str]:
    """The parts to make, in the report's order. Raises RefusedError for a name that is none."""
    unknown = sorted(set(only or ()) - set(PARTS))
    if unknown:
        raise RefusedError(
            Reason.PART_UNKNOWN, f"the report has no part {', '.join(unknown)}.", f"Its parts are {', '.join(PARTS)}."
        )
    return [name for name in PARTS if not only or name in only]


def made(name: str, context: Context) -> Section:
    """The section, or one that says why there is none."""
    try:
        return part(name)(context)
    except (RefusedError, FailedError) as error:
        return Section(name, title_of(name), missing=error.reason)


def title_of(name: str) -> str:
    """A part's heading."""
    from importlib import import_module

    return str(import_module(PARTS[name]).TITLE)


def in_json(section: Section) -> dict[str, Any]:
    """A section in paper.json: its own content; every compared quantity under `compared`, unless the section's keys
    are names of methods."""
    if section.name == "table1":
        return section.content
    compared = [asdict(each) | {"difference": each.difference} for each in section.compared]
    return section.content | {"compared": compared}


PARTS: dict[str, str] = {
    "table1": "lab.paper.table1",
    "reseau": "lab.paper.reseau",
    "table2": "lab.paper.table2",
    "flow": "lab.paper.flow",
    "projection": "lab.paper.projection",
    "similarity": "lab.paper.similarity",
    "limb": "lab.paper.limb",
    "methods": "lab.paper.methods",
    "published": "lab.paper.published",
}


def part(name: str) -> Part:
    """The function that makes the part `name`; imported when it is wanted."""
    found: Part = getattr(import_module(PARTS[name]), name)
    return found
