"""The published attitudes and ranges against SPICE, image by image."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lab.paper.published_geometry import Neighbours, PublishedDifference
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


def longitude_figure(found: Sequence[PublishedDifference]) -> "Figure":
    """Turn about the pole against the longitude that the camera looked at; open marks: the Sun in the west."""
    figure, (panel,) = canvas(1, 1, (9.0, 3.6))
    cameras = list(dict.fromkeys(each.image.camera for each in found))
    for camera, color, marker in zip(cameras, CYCLE, "os^D", strict=False):
        for in_east in (True, False):
            own = [e for e in found if e.image.camera == camera and e.turned and e.sun_in_east == in_east]
            if not own:
                continue
            east = np.array([each.turn_in_body_deg[2] for each in own if each.turn_in_body_deg is not None])
            longitude = (np.array([each.sub_spacecraft_deg[1] for each in own]) + 180) % 360 - 180
            label = f"{camera}, Sun in the {'east' if in_east else 'west'}"
            panel.plot(longitude, np.clip(east, -LARGEST_SHOWN_DEG, LARGEST_SHOWN_DEG), marker, color=color,
                       markerfacecolor=color if in_east else "none", markersize=6, label=label)  # fmt: skip
    panel.axhline(0, color="0.6", linewidth=0.7)
    panel.set_xlabel("sub-spacecraft longitude, deg east")
    panel.set_ylabel("markings moved east, deg")
    panel.set_xticks(range(-180, 181, 30))
    panel.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    bare(panel)
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
