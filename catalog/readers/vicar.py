"""Reader of VICAR images: Galileo SSI, Voyager ISS, and any camera whose label has PDS-like keywords (Cassini)."""

from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from catalog.readers import galileo, pds_keywords, voyager
from catalog.readers.reading import Reading
from catalog.readers.vicar_file import LABEL_START, read_vicar


class VicarDialect(Protocol):
    """How one mission writes its metadata into a VICAR label."""

    def matches(self, label: dict[str, Any]) -> bool:
        """Whether the label is of this mission."""

    def reading(self, path: Path, label: dict[str, Any], pixels: NDArray[Any]) -> Reading:
        """Pixels and metadata; raises RefusedError for values that make no sense."""


DIALECTS: tuple[VicarDialect, ...] = (galileo, voyager, pds_keywords)  # the last one takes any label


class VicarReader:
    """Every VICAR image; the dialect of its label decides how the metadata are read."""

    def recognises(self, head: bytes, path: Path) -> bool:  # noqa: ARG002
        """A VICAR file begins with LBLSIZE=."""
        return LABEL_START.match(head) is not None

    def read(self, path: Path, plane: str | None = None) -> Reading:
        """Pixels and metadata of a VICAR image."""
        label, pixels = read_vicar(path, plane)
        dialect = next(dialect for dialect in DIALECTS if dialect.matches(label))
        return dialect.reading(path, label, pixels)
