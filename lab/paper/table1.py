"""Table 1: retrieving a planted offset. Needs no data."""

from typing import Any

import numpy as np

from lab.paper.charts import offsets_figure
from lab.paper.planted_offset import PLANTED_PX, Retrieved, retrieve_offset
from lab.paper.section import Compared, Context, Picture, Section, Table
from tasks.point.registration import REGISTRATIONS

NAME = "table1"
TITLE = "Table 1: a planted offset, retrieved by every method"
# 2-D cross-correlation, MATLAB's imregcorr (phase correlation) and imregtform (intensity, mean squares).
PAPER_FOUND_PX = {"ncc": (20.0, -30.4), "phase": (20.3, -30.4), "intensity": (22.33, -30.48)}
PAPER_NAME = {"ncc": "2D cross-correlation", "phase": "imregcorr", "intensity": "imregtform"}
TEXT = (
    "A simulated image of Europa (180 px wide, half lit, 0.5 % noise) is predicted (20.32, -30.46) px away from where "
    "it is. Every method starts from the same search of the whole frame and then runs in the paper's loop: register, "
    "turn the camera, render again, until nothing moves. The simulation shares map and photometric law with the image, "
    "as the paper's did: this measures the methods, not the models.",
    "The paper does not say whether its numbers are of one registration or of its loop; so the table also has what our "
    "first registration said (after the search, whose steps are whole pixels or coarser).",
    "The paper chose imregtform, which missed its own planted offset by 2.0 px in x.",
)


def table1(context: Context) -> Section:
    """Every registration against what was planted and what the paper's found."""
    found = {}
    for method in sorted(REGISTRATIONS):
        context.tell(f"table 1: {method}")
        found[method] = retrieve_offset(method)
    figure = offsets_figure(PLANTED_PX, {m: r.found_px for m, r in found.items()}, PAPER_FOUND_PX)
    picture = Picture(context.save(figure, "table1"), "Error of every method, logarithmic; the paper's hatched.")
    return Section(
        NAME,
        TITLE,
        content={method: entry(method, result) for method, result in found.items()},
        compared=[
            each for method, result in found.items() if method in PAPER_FOUND_PX for each in rows(method, result)
        ],
        tables=[table(found)],
        pictures=[picture],
        text=TEXT,
    )


def entry(method: str, result: Retrieved) -> dict[str, Any]:
    """One method in paper.json."""
    paper = PAPER_FOUND_PX.get(method)
    return {
        "planted_px": list(PLANTED_PX),
        "found_px": list(result.found_px),
        "error_px": result.error_px.tolist(),
        "first_px": result.first_px.tolist(),
        "paper_found_px": list(paper) if paper else None,
        "paper_error_px": [round(p - t, 4) for p, t in zip(paper, PLANTED_PX, strict=True)] if paper else None,
        "difference_px": [o - p for o, p in zip(result.found_px, paper, strict=True)] if paper else None,
        "iterations": len(result.history_px),
        "seconds": round(result.seconds, 3),
    }


def rows(method: str, result: Retrieved) -> list[Compared]:
    """The method's two numbers beside the paper's."""
    paper, note = PAPER_FOUND_PX[method], f"the paper's {PAPER_NAME[method]}"
    return [
        Compared(f"{method}, {axis} offset (planted {PLANTED_PX[i]:g})", paper[i], result.found_px[i], "px", 3, note)
        for i, axis in enumerate("xy")
    ]


def table(found: dict[str, Retrieved]) -> Table:
    """All methods, those without a figure in the paper too."""
    header = (
        "method",
        "found x",
        "found y",
        "error x",
        "error y",
        "paper's error x",
        "paper's error y",
        "renderings",
        "s",
    )
    cells = []
    for method, result in found.items():
        paper = PAPER_FOUND_PX.get(method)
        theirs = [p - t for p, t in zip(paper, PLANTED_PX, strict=True)] if paper else [None, None]
        first = np.subtract(result.first_px, PLANTED_PX).tolist()
        cells.append(
            (method, *result.found_px, *result.error_px.tolist(), *first, *theirs, len(result.history_px),
             result.seconds)
        )  # fmt: skip
    return Table("All methods, pixels", header, cells, digits=4)
