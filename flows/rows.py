"""The lines of a command's answer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from catalog.errors import WrongOptionError


@dataclass(frozen=True)
class Row:
    """One line of an answer. text: for people, None where it is none; content: the same as JSON. good: whether all is
    well with it. minor: not shown when the command is to be quiet; aside: a note, for stderr and the log."""

    text: str | None
    content: dict[str, Any] | None = None
    good: bool = True
    minor: bool = False
    aside: bool = False


Show = Callable[[Row], None]


def refuse_unknown(option: str, given: tuple[str, ...], known: tuple[str, ...]) -> None:
    """Raises WrongOptionError for names that are not known."""
    if unknown := [name for name in given if name not in known]:
        raise WrongOptionError(option, f"there is no {', '.join(unknown)}.", f"Known are {', '.join(known)}.")
