"""Distributions of a store's corrections, per camera."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tasks.pictures.canvas import CYCLE, bare

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW_INCHES, HEAD_INCHES, WIDTH_INCHES = 0.55, 1.1, 7.2
SPREAD = 0.28
DPI = 110
NARROW = 100.0


@dataclass(frozen=True)
class Quantity:
    """What is shown: columns of the index, whose size is taken when they are two; log: on a logarithmic axis."""

    name: str
    label: str
    columns: tuple[str, ...]
    meaning: str
    log: bool = False
    digits: int = 4  # significant, in tables

    def values(self, index: "pd.DataFrame") -> np.ndarray:
        """One number per row, NaN where unknown."""
        columns = index[list(self.columns)].to_numpy(np.float64)
        return np.asarray(columns[:, 0] if len(self.columns) == 1 else np.hypot(*columns.T))


QUANTITIES = (
    Quantity("offset", "offset, px", ("offset_x_px", "offset_y_px"), "from predicted to corrected place", True),
    Quantity("range_factor", "range factor", ("range_factor",), "corrected by predicted distance", digits=6),
    Quantity("limb_rms", "limb rms, px", ("limb_rms_px",), "shifts between image and simulation on the lit limb", True),
    Quantity("sigma", "1-sigma of the centre, px", ("centre_x_uncertainty_px", "centre_y_uncertainty_px"),
             "stated uncertainty of the target's centre", True),
    Quantity("target_offset", "O-C of the target, px", ("target_offset_x_px", "target_offset_y_px"),
             "observed less computed place by stars, the camera's error taken out", True),
    Quantity("attitude", "turn of the body, deg", ("attitude_deg",), "by how much the target's attitude was corrected"),
)  # fmt: skip


def distribution_figure(index: "pd.DataFrame", quantity: Quantity) -> "Figure | None":
    """One row per camera, one point per image (hollow: doubtful), the median as a bar; None when nothing is known."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    values = quantity.values(index)
    known = np.isfinite(values) & ((values > 0) | (not quantity.log))
    if not known.any():
        return None
    cameras = sorted(set(index["camera"][known]))
    figure = Figure(figsize=(WIDTH_INCHES, HEAD_INCHES + ROW_INCHES * len(cameras)), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    panel = figure.subplots()
    doubtful = (index["status"] != "ok").to_numpy()
    for row, camera in enumerate(cameras):
        mine = known & (index["camera"] == camera).to_numpy()
        height = row + _spread(int(mine.sum()))
        colour = CYCLE[row % len(CYCLE)]
        for chosen, fill in ((~doubtful[mine], colour), (doubtful[mine], "none")):
            panel.scatter(
                values[mine][chosen], height[chosen], s=26, facecolors=fill, edgecolors=colour, linewidths=1.2
            )
        if mine.sum() > 1:
            panel.plot([np.median(values[mine])] * 2, [row - 0.38, row + 0.38], color="black", linewidth=1.6)
    panel.set_yticks(range(len(cameras)), [f"{c} ({int((known & (index['camera'] == c)).sum())})" for c in cameras])
    panel.set_ylim(len(cameras) - 0.4, -0.6)
    if quantity.log:
        panel.set_xscale("log")
        _plain_ticks(panel, values[known])
    panel.set_xlabel(quantity.label)
    panel.grid(axis="x", color="0.9")
    panel.set_axisbelow(True)
    bare(panel)
    return figure


def _plain_ticks(panel: "Axes", values: np.ndarray) -> None:
    """Numbers as people write them; steps of 1, 2, 5 where the values span little."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    narrow = float(values.max() / values.min()) < NARROW
    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,)))
    panel.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())


def spread_by_camera(index: "pd.DataFrame", quantity: Quantity) -> Sequence[tuple[str, int, float, float, float]]:
    """Camera, number of images, smallest, median, largest."""
    values = quantity.values(index)
    rows = []
    for camera in sorted(set(index["camera"].dropna())):
        mine = values[(index["camera"] == camera).to_numpy() & np.isfinite(values)]
        if mine.size:
            rows.append((str(camera), int(mine.size), float(mine.min()), float(np.median(mine)), float(mine.max())))
    return rows


def _spread(count: int) -> np.ndarray:
    """Heights that keep points apart: the golden ratio's multiples are as even as any."""
    return SPREAD * (2 * np.mod(np.arange(count) * 0.6180339887, 1.0) - 1) if count > 1 else np.zeros(count)
