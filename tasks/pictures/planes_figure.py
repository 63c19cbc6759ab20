"""The planes of a cube, side by side."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import UNUSABLE, Quality
from tasks.pictures.canvas import BLUE, ORANGE, RED, canvas
from tasks.pictures.product import opened_cube

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# cividis and twilight are even in lightness for colour-blind eyes too; longitude runs in a circle.
PANELS = (
    ("latitude", "latitude, deg", "cividis"),
    ("longitude", "east longitude, deg", "twilight"),
    ("incidence", "incidence, deg", "cividis"),
    ("emission", "emission, deg", "cividis"),
    ("phase", "phase, deg", "cividis"),
    ("resolution_km", "resolution, km/px", "cividis"),
    ("latitude_uncertainty", "latitude, 1-sigma, deg", "cividis"),
)
# What a pixel is, the strongest first.
KINDS = (
    ("unusable", RED, UNUSABLE),
    ("off body", "#000000", Quality.OFF_BODY),
    ("limb", ORANGE, Quality.LIMB),
    ("night side", BLUE, Quality.NIGHT_SIDE),
    ("usable", "#F7F7F7", None),
)
MARGIN = 0.06
HIGH_PERCENTILE = 97.0  # resolution and uncertainty grow without bound towards limb and poles
LARGEST_PX = 360
Extent = tuple[float, float, float, float]


def planes_figure(folder: Path) -> "Figure":
    """Eight panels, cut to the body: coordinates, angles, resolution, uncertainty of the latitude, flags."""
    with opened_cube(folder) as cube:
        part = cube.isel(_around_the_body(cube))
        figure, panels = canvas(2, 4, (3.0, 2.9))
        for panel, (name, label, colours) in zip(panels, PANELS, strict=False):
            _draw(panel, part[name].values, _extent(part), label, colours)
        _draw_flags(panels[-1], part["quality"].values, _extent(part))
        figure.suptitle(f"{cube.attrs['product']}: planes of the cube", fontsize=11)
    return figure


def _around_the_body(cube: "xr.Dataset") -> dict[str, slice]:
    """The body with a margin, not more pixels than the figure can show."""
    on_body = (cube["quality"].values & np.uint16(Quality.OFF_BODY)) == 0
    chosen = {}
    for dimension, axis in (("y", 1), ("x", 0)):
        filled = np.flatnonzero(on_body.any(axis=axis))
        low, high = (int(filled[0]), int(filled[-1]) + 1) if filled.size else (0, on_body.shape[1 - axis])
        margin = int(MARGIN * (high - low)) + 2
        chosen[dimension] = (max(low - margin, 0), min(high + margin, on_body.shape[1 - axis]))
    stride = -(-max(high - low for low, high in chosen.values()) // LARGEST_PX)
    return {dimension: slice(low, high, stride) for dimension, (low, high) in chosen.items()}


def _extent(part: "xr.Dataset") -> Extent:
    x, y = part["x"].values, part["y"].values
    return float(x[0]) - 0.5, float(x[-1]) + 0.5, float(y[-1]) + 0.5, float(y[0]) - 0.5


def _draw(panel: "Axes", values: NDArray, extent: Extent, label: str, colours: str) -> None:
    finite = values[np.isfinite(values)]
    limits: dict[str, Any] = {}
    if finite.size:
        low, high = (float(v) for v in np.percentile(finite, (0.5, HIGH_PERCENTILE)))
        limits = {"vmin": low, "vmax": max(high, low + 1e-9)}
    shown = panel.imshow(values, cmap=colours, extent=extent, interpolation="nearest", **limits)
    panel.figure.colorbar(shown, ax=panel, shrink=0.8, extend="max")
    panel.set_title(label if finite.size else f"{label}: unknown", fontsize=9)
    panel.tick_params(labelsize=7)


def _draw_flags(panel: "Axes", quality: NDArray, extent: Extent) -> None:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    kind = np.full(quality.shape, len(KINDS) - 1)
    for number, (_, _, flags) in reversed(list(enumerate(KINDS[:-1]))):
        kind[(quality & np.uint16(flags)) != 0] = number
    colours = ListedColormap([colour for _, colour, _ in KINDS])
    panel.imshow(kind, cmap=colours, vmin=0, vmax=len(KINDS) - 1, extent=extent, interpolation="nearest")
    panel.set_title("flags", fontsize=9)
    panel.tick_params(labelsize=7)
    handles = [Patch(facecolor=colour, edgecolor="0.4", label=name) for name, colour, _ in KINDS]
    panel.legend(handles=handles, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, frameon=False)
