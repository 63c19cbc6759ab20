"""Charts of the report: errors of methods, distributions per camera."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tasks.pictures.canvas import BLUE, CYCLE, ORANGE, bare, canvas

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Pair = tuple[float, float]
FLOOR_PX = 4e-4
MARKERS = ("o", "s", "^", "v", "D", "P", "X", "*", "<")


def offsets_figure(planted_px: Pair, ours: Mapping[str, Pair], paper: Mapping[str, Pair]) -> "Figure":
    """Absolute errors of retrieved offsets, by method and axis, logarithmic; the paper's beside ours."""
    figure, panels = canvas(1, 2, (4.6, 3.6))
    places = np.arange(len(ours))
    for axis, (panel, name) in enumerate(zip(panels, "xy", strict=True)):
        for shift, label, values, style in (
            (-0.2, "planetpose", ours, {"color": BLUE}),
            (0.2, "paper", paper, {"color": ORANGE, "hatch": "//", "edgecolor": "black", "linewidth": 0.5}),
        ):
            at = [i for i, method in enumerate(ours) if method in values]
            heights = [
                max(abs(values[method][axis] - planted_px[axis]), FLOOR_PX) for method in ours if method in values
            ]
            panel.bar(np.array(at) + shift, heights, 0.38, label=label, **style)
        panel.axhline(0.02, color="0.4", linewidth=0.8, linestyle=":")
        panel.set_yscale("log")
        panel.set_ylim(FLOOR_PX / 2, 5)
        panel.set_xticks(places, list(ours), rotation=40, ha="right")
        panel.set_ylabel(f"|error in {name}|, px")
        bare(panel)
    panels[0].legend(frameon=False, loc="upper left", fontsize=8)
    return figure


def histograms_figure(
    groups: Mapping[str, Sequence[float]],
    label: str,
    bins: Sequence[float],
    columns: int = 3,
    mark: float | None = None,
) -> "Figure":
    """One histogram per group, on one scale; a dotted line at `mark`."""
    columns = min(columns, max(len(groups), 1))
    figure, panels = canvas(-(-max(len(groups), 1) // columns), columns, (3.4, 2.6))
    for panel, (name, values), color in zip(panels, groups.items(), CYCLE * 3, strict=False):
        panel.hist(np.clip(values, bins[0], bins[-1]), bins=list(bins), color=color, edgecolor="white", linewidth=0.4)
        if mark is not None:
            panel.axvline(mark, color="black", linewidth=0.9, linestyle=":")
        panel.set_title(f"{name} ({len(values)})", fontsize=10)
        panel.set_xlabel(label)
        bare(panel)
    for spare in panels[len(groups) :]:
        spare.set_axis_off()
    panels[0].set_ylabel("images")
    return figure


def centres_figure(centres: Mapping[str, Mapping[str, Sequence[float]]], reference: str) -> "Figure":
    """One panel per image: where each method puts the disk's centre, relative to the method `reference`; a method looks
    the same in all of them."""
    figure, panels = canvas(1, max(len(centres), 1), (3.3, 3.3))
    methods = list(dict.fromkeys(method for own in centres.values() for method in own))
    looks: dict[str, dict[str, Any]] = {
        m: {"color": CYCLE[i % len(CYCLE)], "marker": MARKERS[i % len(MARKERS)]} for i, m in enumerate(methods)
    }
    for panel, (title, own) in zip(panels, centres.items(), strict=True):
        origin = np.array(own.get(reference, next(iter(own.values()), (0.0, 0.0))))
        for method, centre in own.items():
            x, y = np.array(centre) - origin
            panel.plot(x, y, markersize=7, label=method, linestyle="", **looks[method])
        panel.set_title(title, fontsize=9)
        panel.set_aspect("equal", adjustable="datalim")
        panel.invert_yaxis()
        panel.grid(color="0.9")
        panel.set_xlabel("x, px")
        bare(panel)
    panels[0].set_ylabel("y, px")
    legend = {
        label: handle for panel in panels for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(legend.values(), legend.keys(), loc="outside right center", fontsize=8, frameon=False)
    return figure
