"""What the body of a step is given beside its inputs and files."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Progress = Callable[[str, int, str], None]


@dataclass(frozen=True)
class Work:
    """folder: empty; files that belong to the result go there. progress: called with (step, iteration, message)."""

    folder: Path
    progress: Progress


@dataclass(frozen=True)
class NoFiles:
    """The files of a step that reads none."""
