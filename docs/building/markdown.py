"""Pieces of Markdown."""

from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; cells are one line each."""
    lines = [line(head), line("---" for _ in head), *(line(row) for row in rows)]
    return "\n".join(lines) + "\n"


def line(cells: Iterable[object]) -> str:
    """One row of a table."""
    return "| " + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def code(value: object) -> str:
    """Something in the computer's letters; nothing for nothing."""
    return f"`{value}`" if str(value) else ""


def block(text: str, language: str = "text") -> str:
    """Text word for word."""
    return f"```{language}\n{text.rstrip()}\n```\n"
