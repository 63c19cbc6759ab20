"""Pages made from the program: a line `<!-- made from: NAME ARGUMENT -->` becomes what the maker NAME says."""

import re
from collections.abc import Callable
from typing import Any

from sphinx.application import Sphinx

from building import api, cameras, commands, facts, outside, profiles, reasons, settings, targets

LINE = re.compile(r"^<!-- made from: (\S+) ?(.*?) -->$", re.M)
MAKERS: dict[str, Callable[[str], str]] = {
    "api": api.page_of,
    "face": api.public_face,
    "camera": cameras.section_of,
    "cameras": cameras.table,
    "commands": commands.page,
    "facts": facts.text_of,
    "outside": outside.text_of,
    "profiles": profiles.page,
    "reasons": reasons.table,
    "planes": targets.planes,
    "settings": settings.page,
    "targets": targets.table,
    "further-targets": targets.further,
}


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the replacement."""
    app.connect("source-read", replace)
    app.connect("env-get-outdated", made_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def replace(app: Sphinx, page: str, source: list[str]) -> None:  # noqa: ARG001
    """Put what the makers say into a page's text."""
    source[0] = with_made_parts(source[0])


def with_made_parts(text: str) -> str:
    """Text of a page with its made parts. Raises KeyError for an unknown maker."""
    return LINE.sub(lambda found: MAKERS[found[1]](found[2]), text)


def made_pages(app: Sphinx, env: Any, added: set[str], changed: set[str], removed: set[str]) -> list[str]:  # noqa: ARG001
    """Pages with made parts are read anew at every build: the program may have changed."""
    return [page for page in env.found_docs if LINE.search(env.doc2path(page).read_text(encoding="utf-8"))]
