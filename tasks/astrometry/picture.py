"""The picture of a store's astrometry: measured less computed places, with errors."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tasks.astrometry.observation import Row
from tasks.pictures.canvas import CYCLE, DRAWING, bare, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANEL_INCHES = (5.6, 4.2)
MARKERS = "osD^vP*X"
AXES = (("oc_ra_arcsec", "sigma_ra_arcsec", "RA cos(Dec)"), ("oc_dec_arcsec", "sigma_dec_arcsec", "Dec"))


def draw_observed_less_computed(rows: Sequence[Row], path: Path) -> Path:
    """Write O-C of the observations (see `observation.COLUMNS`) as PNG: both coordinates against each other, in
    arcseconds and in pixels, and each against time; one colour and shape per body. Returns the path."""
    with DRAWING:
        figure, panels = canvas(2, 2, PANEL_INCHES)
        for number, body in enumerate(sorted({str(row["body"]) for row in rows})):
            own = [row for row in rows if row["body"] == body]
            style: dict[str, Any] = {
                "color": CYCLE[number % len(CYCLE)], "marker": MARKERS[number % len(MARKERS)], "markersize": 5,
                "linestyle": "none", "elinewidth": 0.9, "label": f"{body} ({len(own)})",
            }  # fmt: skip
            _draw(panels, own, style)
        zero: dict[str, Any] = {"color": "0.6", "linewidth": 0.8, "zorder": 0}
        for panel in panels:
            panel.axhline(0, **zero)
            bare(panel)
        for panel in panels[:2]:
            panel.axvline(0, **zero)
            panel.set_aspect("equal", adjustable="datalim")
        panels[0].set(xlabel="O-C, RA cos(Dec), arcsec", ylabel="O-C, Dec, arcsec")
        panels[1].set(xlabel="O-C, sample, px", ylabel="O-C, line, px")
        for panel, (_, __, label) in zip(panels[2:], AXES, strict=True):
            panel.set(xlabel="UTC", ylabel=f"O-C, {label}, arcsec")
            panel.tick_params(axis="x", labelrotation=20, labelsize=8)
        panels[0].legend(fontsize=8)
        figure.savefig(path, format="png")
    return path


def _draw(panels: "Sequence[Axes]", rows: Sequence[Row], style: dict[str, Any]) -> None:
    x, y, sigma_x, sigma_y = (_numbers(rows, name) for axis in (0, 1) for name in (AXES[0][axis], AXES[1][axis]))
    panels[0].errorbar(x, y, yerr=sigma_y, xerr=sigma_x, **style)
    panels[1].errorbar(_numbers(rows, "oc_sample_px"), _numbers(rows, "oc_line_px"), **style)
    times = np.array([str(row["utc"]).rstrip("Z") for row in rows], "datetime64[ms]")
    for panel, value, sigma in ((panels[2], x, sigma_x), (panels[3], y, sigma_y)):
        panel.errorbar(times, value, yerr=sigma, **style)


def _numbers(rows: Sequence[Row], name: str) -> np.ndarray:
    """Values of a column; NaN where unknown."""
    return np.array([np.nan if row[name] is None else row[name] for row in rows], dtype=np.float64)
