"""Files that are not on this machine and whose content is known all the same, so that keys can be made without them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Absent:
    """path: where the file would be. sha256: of its content. other: the other file of an image, label or pixels."""

    path: Path
    sha256: str
    other: Path | None = None


_known: dict[Path, Absent] = {}


@contextmanager
def standing_in(*files: Absent) -> Iterator[None]:
    """Within the `with` block these are known."""
    _known.update({file.path: file for file in files})
    try:
        yield
    finally:
        for file in files:
            _known.pop(file.path, None)


def absent_file(path: Path) -> Absent | None:
    """What is known of a file; None where nothing is."""
    return _known.get(path)
