"""Section 5 of the paper: optical flow of a turned Europa, and the turn that Kabsch makes of it. Needs no data."""

import numpy as np

from lab.paper.flow_figure import flow_figure
from lab.paper.planted_turn import PLANTED_TURNS_DEG, PlantedTurn, flow_seconds, retrieve_turn
from lab.paper.section import Compared, Context, Picture, Section, Table

NAME = "flow"
TITLE = "Optical flow of a turned Europa"
BAR_DEG, BAR_S = 0.05, 1.0
TEXT = (
    "A simulated Europa, 200 px wide, is predicted turned by up to 3 deg; boxes of 13 px are sought in boxes of 21 px "
    "as in the paper, on images freed of shading, and Kabsch's rotation of the matching points on the ellipsoid "
    "turns the prediction back. The paper shows such a field and gives no number; the bars are our own: 0.05 deg, and "
    "1 s for the flow of 1024x1024 pixels.",
)


def flow(context: Context) -> Section:
    """Planted turns, what was found, and the field of vectors."""
    turns = []
    for planted in PLANTED_TURNS_DEG:
        context.tell(f"flow: a turn of {np.linalg.norm(planted):.1f} deg")
        turns.append(retrieve_turn(planted))
    seconds = flow_seconds()
    errors = [turn.error_deg for turn in turns]
    worst = None if None in errors else max(float(error) for error in errors if error is not None)
    header = ("planted size, deg", "planted x, y, z", "found x, y, z", "left, deg", "s")
    rows = [(float(np.linalg.norm(t.planted_deg)), _three(t.planted_deg), _three(t.found_deg), t.error_deg, t.seconds)
            for t in turns]  # fmt: skip
    return Section(
        NAME,
        TITLE,
        content={"turns": [entry(turn) for turn in turns], "flow_1024_s": seconds},
        compared=[
            Compared("largest error of a planted turn", None, worst, "deg", 3, f"bar {BAR_DEG} deg"),
            Compared("flow of 1024x1024 pixels", None, seconds, "s", 2, f"bar {BAR_S:.0f} s"),
        ],
        tables=[Table("Planted and found, degrees in the body's own frame", header, rows, 3)],
        pictures=[
            Picture(
                context.save(flow_figure(turns), "flow"),
                "Displacement of the markings from simulation to image, three times enlarged; none where it is larger "
                "than the search box allows, which the later, turned comparisons see.",
                "figure 19",
            )
        ],
        text=TEXT,
    )


def entry(turn: PlantedTurn) -> dict[str, object]:
    """One turn in paper.json."""
    found = None if turn.found_deg is None else list(turn.found_deg)
    return {"planted_deg": list(turn.planted_deg), "found_deg": found, "error_deg": turn.error_deg}


def _three(angles: tuple[float, ...] | None) -> str | None:
    return None if angles is None else ", ".join(f"{angle:+.3f}" for angle in angles)
