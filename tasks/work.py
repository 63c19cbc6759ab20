"""What the body of a step is given."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Progress = Callable[[str, int, str], None]


@dataclass(frozen=True)
class Work:
    """inputs: what the result depends on, plain JSON. places: where things are (source file, folders of earlier steps).
    folder: empty; files that belong to the result go there. progress: called with (step, iteration, message)."""

    inputs: Mapping[str, Any]
    places: Mapping[str, Any]
    folder: Path
    progress: Progress

    def place(self, name: str) -> Path:
        """One of `places` as a path."""
        return Path(self.places[name])
