"""The list of pages at the left of each page, with only the chapter open to which the page belongs.

Sphinx resolves all lists of pages for each page anew, and the theme reads all of them once more: half of the building
of this site. A chapter that is not open needs one line.
"""

from collections.abc import Iterator
from html import escape
from typing import Any

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

# Before the theme asks for the list: its own handler has Sphinx's usual 500.
BEFORE_THEME = 400


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the list."""
    app.connect("html-page-context", put_into_context, priority=BEFORE_THEME)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def put_into_context(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:  # noqa: ARG001
    """Have the theme take this module's list for Sphinx's."""
    if "toctree" in context:
        context["toctree"] = lambda **_: list_of_pages(app, page)


def list_of_pages(app: Sphinx, page: str) -> str:
    """Pages below the first one as nested HTML lists, in the classes that Sphinx gives them; a page's own pages are
    listed where it is `page` or holds it."""
    env: BuildEnvironment = app.env
    opened = {page, *holders(env, page)}

    def listed(parent: str, level: int) -> Iterator[str]:
        yield "<ul>"
        for child in env.toctree_includes.get(parent, []):
            current = " current" if child in opened else ""
            here = "#" if child == page else app.builder.get_relative_uri(page, child)
            title = escape(env.titles[child].astext())
            # The theme puts its arrow behind the first thing in an entry.
            link = f'<a class="reference internal{current}" href="{escape(here)}">{title}</a>'
            yield f'<li class="toctree-l{level}{current}">{link}'
            if current and env.toctree_includes.get(child):
                yield from listed(child, level + 1)
            yield "</li>"
        yield "</ul>"

    return "\n".join(listed(env.config.root_doc, 1))


def holders(env: BuildEnvironment, page: str) -> set[str]:
    """The pages that list `page`, and those that list them."""
    found: set[str] = set()
    sought = [page]
    while sought:
        child = sought.pop()
        new = {parent for parent, children in env.toctree_includes.items() if child in children} - found
        found |= new
        sought.extend(new)
    return found
