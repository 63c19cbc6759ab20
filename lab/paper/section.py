"""A part of the report: what it says, in words that both JSON and HTML understand."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Cell = str | float | int | None
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Compared:
    """One quantity: the paper's number, ours, and ours minus the paper's (None where one of them is missing)."""

    quantity: str
    paper: float | None
    ours: float | None
    unit: str = ""
    digits: int = 2
    note: str = ""

    @property
    def difference(self) -> float | None:
        """Ours minus the paper's."""
        return None if self.paper is None or self.ours is None else self.ours - self.paper


@dataclass(frozen=True)
class Table:
    """Rows of cells under a header; floats are printed with `digits` decimals."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    digits: int = 2


@dataclass(frozen=True)
class Picture:
    """file: name in the report's folder `figures`. paper: which of the paper's figures it repeats, if any."""

    file: str
    caption: str
    paper: str = ""


@dataclass(frozen=True)
class Section:
    """name: its key in paper.json. content: what stands there, plain JSON. missing: why there is nothing, or None."""

    name: str
    title: str
    content: dict[str, Any] = field(default_factory=dict)
    compared: Sequence[Compared] = ()
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    text: Sequence[str] = ()
    missing: str | None = None


@dataclass(frozen=True)
class Context:
    """figures: folder for pictures. cache: of steps' results. data: real mission files, or None. evaluation: a folder
    written by `planetpose evaluate`, or None. tell: progress."""

    figures: Path
    cache: Path
    data: Path | None
    evaluation: Path | None
    tell: Tell

    def save(self, figure: "Figure", name: str) -> str:
        """Write a figure as PNG and return its file name."""
        self.figures.mkdir(parents=True, exist_ok=True)
        figure.savefig(self.figures / f"{name}.png", format="png")
        return f"{name}.png"


NO_DATA = "no real mission files here: set PLANETPOSE_DATA to the folder that holds images/ and kernels/"
Part = Callable[[Context], Section]
