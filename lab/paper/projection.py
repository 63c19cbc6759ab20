"""Section 6 of the paper: the vectorised projection against a loop over SPICE's SINCPT."""

from lab.benchmark.projection import benchmark_projection
from lab.paper.section import Compared, Context, Section

NAME = "projection"
TITLE = "Projection of 1024x1024 pixels against SPICE's SINCPT in a loop"
PAPER_S, PAPER_LOOP_S = 0.45, 93.0
TEXT = (
    "Latitude, longitude, incidence, emission and phase of every pixel of a frame that the disk fills, on this "
    "machine. The SPICE loop (SINCPT, ILUMIN, RECLAT) is timed on some thousand pixels and scaled up.",
    "The paper's quadric is printed with 1/r on its diagonal; with 1/r^2, and three radii, it agrees with SPICE.",
)


def projection(context: Context) -> Section:
    """Time and agreement. Needs no data."""
    context.tell("projection: timing")
    figures = benchmark_projection()
    largest = figures["max_difference_deg"]
    return Section(
        NAME,
        TITLE,
        content=figures,
        compared=[
            Compared("vectorised projection", PAPER_S, figures["ours_s"], "s", 3, "another machine"),
            Compared("plain numpy", PAPER_S, figures["numpy_s"], "s", 3, "what the paper's method costs here"),
            Compared("loop over SINCPT", PAPER_LOOP_S, figures["spice_loop_s"], "s", 1, "another machine"),
            Compared("times faster than the loop", PAPER_LOOP_S / PAPER_S, figures["times_faster_than_spice"], "", 0),
            Compared("largest angle between ours and SPICE's", None, largest, "deg", 12, "at the limb too"),
        ],
        text=TEXT,
    )
