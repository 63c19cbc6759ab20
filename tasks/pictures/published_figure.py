"""The published attitudes and ranges against SPICE, image by image."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tasks.paper.published import Neighbours, PublishedDifference
from tasks.pictures.canvas import BLUE, CYCLE, GREEN, ORANGE, bare, canvas

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LARGEST_SHOWN_DEG = 2.0
AXES = (("about x", BLUE, "o"), ("about y", ORANGE, "s"), ("roll", GREEN, "^"))


def published_figure(found: Sequence[PublishedDifference], pairs: Sequence[Neighbours]) -> "Figure":
    """Above: turn of the body per image, in camera axes, neighbours joined; below: range factors, and how far the
    attitudes of neighbours disagree."""
    figure, panels = canvas(2, 1, (11.0, 3.6))
    names = [each.image.image for each in found]
    _turns(panels[0], found, pairs, names)
    _ranges(panels[1], found)
    for panel in panels:
        _cameras(panel, found)
        bare(panel)
    panels[1].set_xticks(range(len(names)), names, rotation=90, fontsize=6)
    panels[0].set_xticks([])
    return figure


def sunward_figure(found: Sequence[PublishedDifference]) -> "Figure":
    """Where each correction moves the markings in mid-disk, turned so that the Sun is above; one panel per camera."""
    cameras = list(dict.fromkeys(each.image.camera for each in found))
    figure, panels = canvas(1, len(cameras), (2.9, 3.2))
    for panel, camera, color in zip(panels, cameras, CYCLE, strict=False):
        moves = [each.sunward_across_deg for each in found if each.image.camera == camera and each.turned]
        shown = np.clip(np.array(moves, float).reshape(-1, 2), -LARGEST_SHOWN_DEG, LARGEST_SHOWN_DEG)
        panel.plot(shown[:, 1], shown[:, 0], "o", color=color, markersize=5, alpha=0.8)
        panel.axhline(0, color="0.6", linewidth=0.7)
        panel.axvline(0, color="0.6", linewidth=0.7)
        panel.set_xlim(-LARGEST_SHOWN_DEG * 1.05, LARGEST_SHOWN_DEG * 1.05)
        panel.set_ylim(-LARGEST_SHOWN_DEG * 1.05, LARGEST_SHOWN_DEG * 1.05)
        panel.set_aspect("equal")
        panel.set_title(f"{camera} ({len(moves)})", fontsize=9)
        panel.set_xlabel("across, deg", fontsize=8)
        panel.tick_params(labelsize=7)
        bare(panel)
    panels[0].set_ylabel("towards the Sun, deg", fontsize=8)
    return figure


def disagreement_figure(pairs: Sequence[Neighbours]) -> "Figure":
    """Histogram of how far the attitude corrections of neighbours disagree."""
    figure, (left, right) = canvas(1, 2, (5.0, 3.2))
    cameras = list(dict.fromkeys(pair.first.image.camera for pair in pairs))
    turned = [[p for p in pairs if p.first.image.camera == camera and p.turned] for camera in cameras]
    for panel, values, limit, label in (
        (left, [[p.angle_deg for p in own] for own in turned], LARGEST_SHOWN_DEG, "disagreement in attitude, deg"),
        (right, [[p.surface_px for p in own] for own in turned], 3.0, "disagreement in mid-disk, px"),
    ):
        shown = [np.minimum(own, limit * 0.999) for own in values]
        panel.hist(shown, bins=np.linspace(0, limit, 17).tolist(), stacked=True, color=list(CYCLE[: len(cameras)]),
                   label=cameras, edgecolor="white", linewidth=0.4)  # fmt: skip
        panel.set_xlabel(f"{label} (last bin: and more)")
        bare(panel)
    left.set_ylabel("pairs")
    left.legend(fontsize=8, frameon=False)
    return figure


def _turns(panel, found, pairs, names) -> None:  # type: ignore[no-untyped-def]
    for axis, (label, color, marker) in enumerate(AXES):
        at = [i for i, each in enumerate(found) if each.turn_deg is not None]
        values = [float(found[i].turn_deg[axis]) for i in at]
        shown = np.clip(values, -LARGEST_SHOWN_DEG, LARGEST_SHOWN_DEG)
        panel.plot(at, shown, linestyle="", marker=marker, color=color, markersize=4, label=label)
        for pair in pairs:
            ends = [names.index(each.image.image) for each in (pair.first, pair.second)]
            heights = [float(each.turn_deg[axis]) for each in (pair.first, pair.second)]
            panel.plot(ends, np.clip(heights, -LARGEST_SHOWN_DEG, LARGEST_SHOWN_DEG), color=color, linewidth=1)
    panel.axhline(0, color="0.6", linewidth=0.7)
    panel.set_ylabel("turn of Europa, deg")
    panel.legend(fontsize=8, frameon=False, ncols=3, loc="upper right")


def _ranges(panel, found) -> None:  # type: ignore[no-untyped-def]
    at = [i for i, each in enumerate(found) if each.range_factor is not None]
    panel.plot(at, [found[i].range_factor for i in at], "o", color=BLUE, markersize=4, label="published / SPICE")
    before = [found[i].range_factor_before for i in at]
    panel.plot(at, before, "x", color=ORANGE, markersize=4, label="the same without kdist")
    panel.axhline(1, color="0.6", linewidth=0.7)
    panel.set_ylabel("range factor")
    panel.legend(fontsize=8, frameon=False, loc="lower right")


def _cameras(panel, found) -> None:  # type: ignore[no-untyped-def]
    cameras = [each.image.camera for each in found]
    for camera in dict.fromkeys(cameras):
        first = cameras.index(camera)
        panel.axvline(first - 0.5, color="0.8", linewidth=0.7)
        panel.annotate(camera, (first, 1.01), xycoords=("data", "axes fraction"), fontsize=8, va="bottom")
    panel.set_xlim(-0.7, len(cameras) - 0.3)
