"""Reliability diagram: do errors keep to their stated uncertainty, and does the verdict tell good from bad?"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tasks.pictures.canvas import BLUE, CYCLE, ORANGE, RED, bare, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = {"centre_px": "centre", "range_factor": "range", "attitude_deg": "attitude"}
COLOURS = {"ok": BLUE, "doubtful": ORANGE}
LEAST_PX = 3e-3


def reliability_figure(rows: Sequence[dict[str, Any]], profile: str) -> "Figure":
    """Two panels for the images of one profile (rows of an evaluation). Left: the share of components within k sigma,
    k from 0 to 4, beside the normal distribution's. Right: true error of each centre by its stated 1-sigma."""
    own = [row for row in rows if row["profile"] == profile and row["after"]]
    figure, (shares, centres) = canvas(1, 2, (4.6, 3.8))
    _shares(shares, own)
    _centres(centres, own)
    figure.suptitle(f"{profile}: {len(own)} of {sum(row['profile'] == profile for row in rows)} images published")
    return figure


def _shares(panel: "Axes", rows: Sequence[dict[str, Any]]) -> None:
    from scipy.special import erf

    limits = np.linspace(0, 4, 81)
    panel.plot(limits, erf(limits / np.sqrt(2)), color="0.5", linestyle=":", label="normal distribution")
    for colour, (kind, label) in zip(CYCLE, KINDS.items(), strict=False):
        sizes = np.abs([ratio for row in rows if row["sigmas"] for ratio in row["sigmas"][kind] or ()])
        if sizes.size:
            within = (sizes[None, :] < limits[:, None]).mean(axis=1)
            panel.step(limits, within, where="post", color=colour, label=f"{label} ({sizes.size})")
    panel.set_xlabel("k")
    panel.set_ylabel("share of errors within k sigma")
    panel.set_ylim(0, 1.02)
    panel.legend(frameon=False, fontsize=8, loc="lower right")
    bare(panel)


def _centres(panel: "Axes", rows: Sequence[dict[str, Any]]) -> None:
    stated = [row for row in rows if (row["uncertainty"] or {}).get("centre_px")]
    sigma = np.array([np.hypot(*row["uncertainty"]["centre_px"]) for row in stated])
    error = np.array([row["after"]["centre_error_px"] for row in stated])
    for status, colour in COLOURS.items():
        chosen = np.array([row["status"] == status for row in stated], dtype=bool)
        if chosen.any():
            panel.plot(
                sigma[chosen], np.maximum(error[chosen], LEAST_PX), "o", color=colour, markersize=4, label=status
            )
    if sigma.size:
        ends = np.array([sigma.min() / 1.5, sigma.max() * 1.5])
        panel.plot(ends, ends, color="0.5", linestyle=":", label="1 sigma")
        panel.plot(ends, 5 * ends, color=RED, linestyle=":", label="5 sigma")
        panel.legend(frameon=False, fontsize=8)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel("stated 1-sigma of the centre, px")
    panel.set_ylabel("true error of the centre, px")
    bare(panel)
