"""The paper's figures 14 to 18: segments across the lit limb, image beside simulation, before and after."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tasks.pictures.canvas import BLUE, DRAWING, GREEN, ORANGE, RED, SKY, YELLOW, bare, canvas, show_image
from tasks.pictures.limb_profiles import LimbComparison, LimbProfiles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN_ON_IMAGE = 90
GRID = (3, 4)
IMAGE: dict[str, Any] = {"color": BLUE, "linestyle": "-", "linewidth": 1.4, "label": "image"}
SIMULATION: dict[str, Any] = {"color": ORANGE, "linestyle": (0, (5, 2)), "linewidth": 1.6, "label": "simulation"}
LIMB: dict[str, Any] = {"color": RED, "linestyle": ":", "linewidth": 1.4}


def write_limb_figures(comparison: LimbComparison, folder: Path, stem: str = "limb") -> dict[str, Path]:
    """Draw all four as PNG into `folder`: segments, profiles, derivatives, shifts. Returns their paths by name."""
    drawers: dict[str, Callable[[LimbComparison], Figure]] = {
        "segments": segments_figure,
        "profiles": profiles_figure,
        "derivatives": derivatives_figure,
        "shifts": shifts_figure,
    }
    folder.mkdir(parents=True, exist_ok=True)
    paths = {name: folder / f"{stem}-{name}.png" for name in drawers}
    with DRAWING:
        for name, draw in drawers.items():
            draw(comparison).savefig(paths[name], format="png")
    return paths


def segments_figure(comparison: LimbComparison) -> "Figure":
    """Figure 14: the segments on the image, under the corrected pose, coloured by shift; both limbs."""
    after, product = comparison.after, comparison.product
    figure, (panel,) = canvas(1, 1, (8.0, 6.6))
    show_image(panel, product.observation.image)
    if comparison.before is not None:
        panel.plot(*_closed(comparison.before.limb_px), color=YELLOW, linestyle=(0, (6, 4)), linewidth=1.2,
                   label="predicted limb")  # fmt: skip
    panel.plot(*_closed(after.limb_px), color=SKY, linewidth=0.9, label="corrected limb")
    _draw_segments(panel, after)
    panel.set_title(f"{product.name}: {len(after.shift_px)} segments on the lit limb, {shift_text(after)}", fontsize=10)
    _frame_limb(panel, comparison)
    panel.legend(loc="upper right", fontsize=8)
    return figure


def profiles_figure(comparison: LimbComparison) -> "Figure":
    """Figure 15: brightness along segments spread over the lit limb, image and simulation."""
    after = comparison.after
    return _grid(comparison, "brightness", lambda i: (after.steps_px[i], after.image[i], after.simulation[i]))


def derivatives_figure(comparison: LimbComparison) -> "Figure":
    """Figure 16: how fast brightness falls along the same segments."""
    after = comparison.after
    image, simulation = after.falls(after.image), after.falls(after.simulation)
    return _grid(comparison, "fall per px", lambda i: (after.steps_px[i][1:-1], image[i], simulation[i]))


def shifts_figure(comparison: LimbComparison) -> "Figure":
    """Figures 17 and 18, and the histogram: one segment, its derivative and all shifts, before and after."""
    states = {"predicted": comparison.before, "corrected": comparison.after}
    shown = {name: found for name, found in states.items() if found is not None}
    figure, panels = canvas(len(shown), 3, (4.0, 3.1))
    one = int(np.argsort(_angle(comparison.after))[len(comparison.after.shift_px) // 2])
    place = comparison.after.segments.xy_px[one]
    for row, (name, found) in enumerate(shown.items()):
        three = panels[3 * row : 3 * row + 3]
        nearest = int(np.argmin(np.linalg.norm(found.segments.xy_px - place, axis=1)))
        _draw_one(three[0], three[1], found, nearest, name)
        _histogram(three[2], found, name)
    apart = "behind the camera" if np.isinf(comparison.apart_px) else f"{comparison.apart_px:.0f} px away"
    lost = "" if comparison.before is not None else f" (predicted limb {apart}: no segments there)"
    figure.suptitle(f"{comparison.product.name}{lost}", fontsize=11)
    return figure


def shift_text(found: LimbProfiles) -> str:
    """The shifts in words."""
    return "too few to judge" if found.rms_px is None else f"shift {found.rms_px:.2f} px rms"


def _draw_segments(panel: "Axes", found: LimbProfiles) -> None:
    from matplotlib.collections import LineCollection

    chosen = _spread(found, SHOWN_ON_IMAGE)
    half = found.settings.half_px
    away = np.where(found.segments.horizontal[chosen, None], [half, 0], [0, half])
    xy = found.segments.xy_px[chosen]
    limit = max(float(np.percentile(np.abs(found.shift_px), 95)), 0.05) if len(chosen) else 1.0
    lines = LineCollection(list(np.stack([xy - away, xy + away], axis=1)), cmap="viridis", linewidths=1.4)
    lines.set_array(found.shift_px[chosen])
    lines.set_clim(-limit, limit)
    panel.add_collection(lines)
    panel.figure.colorbar(lines, ax=panel, label="image minus simulation, px outward", shrink=0.75, extend="both")


def _grid(
    comparison: LimbComparison, label: str, curves: Callable[[int], tuple[NDArray, NDArray, NDArray]]
) -> "Figure":
    found = comparison.after
    figure, panels = canvas(*GRID, (3.0, 2.2))
    chosen = _spread(found, len(panels))
    for panel, index in zip(panels, chosen, strict=False):
        steps, image, simulation = curves(int(index))
        panel.plot(steps, image, marker="o", markersize=2.5, **IMAGE)
        panel.plot(steps, simulation, **SIMULATION)
        panel.axvline(0, **LIMB)
        kind = "row" if found.segments.horizontal[index] else "column"
        x, y = found.segments.xy_px[index]
        panel.set_title(f"{kind} at ({x:.0f}, {y:.0f}), shift {found.shift_px[index]:+.2f} px", fontsize=8)
        panel.tick_params(labelsize=7)
        bare(panel)
    for spare in panels[len(chosen) :]:
        spare.set_axis_off()
    for panel in panels[-GRID[1] :]:
        panel.set_xlabel("px outward of the corrected limb", fontsize=8)
    for panel in panels[:: GRID[1]]:
        panel.set_ylabel(label, fontsize=8)
    panels[0].legend(fontsize=7, frameon=False)
    figure.suptitle(f"{comparison.product.name}: {label} along limb segments, {shift_text(found)}", fontsize=11)
    return figure


def _draw_one(left: "Axes", right: "Axes", found: LimbProfiles, index: int, name: str) -> None:
    steps = found.steps_px[index]
    falls = found.falls(found.image)[index], found.falls(found.simulation)[index]
    for panel, x, curves in (
        (left, steps, (found.image[index], found.simulation[index])),
        (right, steps[1:-1], falls),
    ):
        panel.plot(x, curves[0], **IMAGE)
        panel.plot(x, curves[1], **SIMULATION)
        panel.axvline(0, **LIMB)
        panel.set_xlabel(f"px outward of the {name} limb", fontsize=8)
        panel.tick_params(labelsize=7)
        bare(panel)
    left.set_title(f"{name}: one segment", fontsize=9)
    right.set_title(f"its derivative, shift {found.shift_px[index]:+.2f} px", fontsize=9)
    left.legend(fontsize=7, frameon=False)


def _histogram(panel: "Axes", found: LimbProfiles, name: str) -> None:
    reach = max(1.0, float(np.percentile(np.abs(found.shift_px), 99))) if len(found.shift_px) else 1.0
    color = ORANGE if name == "predicted" else GREEN
    panel.hist(found.shift_px, bins=np.linspace(-reach, reach, 41).tolist(), color=color)
    panel.axvline(0, **LIMB)
    panel.set_xlabel("shift of the image, px outward", fontsize=8)
    panel.set_title(f"{name}: {len(found.shift_px)} segments, {shift_text(found)}", fontsize=9)
    panel.tick_params(labelsize=7)
    bare(panel)


def _angle(found: LimbProfiles) -> NDArray[np.float64]:
    """Position angle of each segment around the disk, counted from the gap in the lit limb, radians."""
    away = found.segments.xy_px - np.nanmean(found.limb_px, axis=0)
    lit = found.segments.normal.mean(axis=0)
    return np.mod(np.arctan2(away[:, 1], away[:, 0]) - np.arctan2(-lit[1], -lit[0]), 2 * np.pi)


def _spread(found: LimbProfiles, count: int) -> NDArray[np.intp]:
    """Indices of up to `count` segments, evenly around the lit limb."""
    order = np.argsort(_angle(found)) if len(found.shift_px) else np.zeros(0, np.intp)
    return order if len(order) <= count else order[np.linspace(0, len(order) - 1, count).astype(int)]


def _closed(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.vstack([xy, xy[:1]]).T


def _frame_limb(panel: "Axes", comparison: LimbComparison) -> None:
    """Show the disk with a margin, within the frame."""
    xy = comparison.after.limb_px if comparison.before is None else np.vstack(
        [comparison.after.limb_px, comparison.before.limb_px]
    )  # fmt: skip
    nx, ny = comparison.product.scene.camera.size_px
    low, high = np.nanmin(xy, axis=0), np.nanmax(xy, axis=0)
    margin = 0.08 * float((high - low).max()) + comparison.after.settings.half_px
    panel.set_xlim(max(low[0] - margin, -0.5), min(high[0] + margin, nx - 0.5))
    panel.set_ylim(min(high[1] + margin, ny - 0.5), max(low[1] - margin, -0.5))
    panel.set_xlabel("x, px")
    panel.set_ylabel("y, px")
