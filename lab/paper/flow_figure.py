"""Optical flow between image and simulation as a field of arrows."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lab.paper.planted_turn import PlantedTurn
from tasks.pictures.canvas import canvas, show_image

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEP_PX = 9
MIN_CORRELATION = 0.5


def flow_figure(turns: Sequence[PlantedTurn]) -> "Figure":
    """One panel per planted turn: the image, and every ninth vector from where the simulation has it to the image."""
    figure, panels = canvas(1, len(turns), (5.0, 4.6))
    for panel, turn in zip(panels, turns, strict=True):
        show_image(panel, turn.image)
        good = turn.flow.valid & (turn.flow.correlation >= MIN_CORRELATION)
        grid = np.zeros(good.shape, bool)
        grid[::STEP_PX, ::STEP_PX] = True
        y, x = np.nonzero(good & grid)
        vectors = turn.flow.displacement[y, x]
        length = np.linalg.norm(vectors, axis=1)
        arrows = panel.quiver(x, y, vectors[:, 0], vectors[:, 1], length, angles="xy", scale_units="xy", scale=0.3,
                              cmap="viridis", width=0.005, edgecolor="black", linewidth=0.3)  # fmt: skip
        figure.colorbar(arrows, ax=panel, label="px", shrink=0.75)
        panel.set_axis_off()
        planted = ", ".join(f"{angle:+.1f}" for angle in turn.planted_deg)
        left = "undetermined" if turn.error_deg is None else f"left {turn.error_deg:.3f} deg"
        panel.set_title(f"turned by ({planted}) deg, {left}", fontsize=9)
    return figure
