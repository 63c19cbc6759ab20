"""The planes of a cube, side by side."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from catalog.observation import UNUSABLE, Quality
from tasks.pictures.canvas import BLUE, ORANGE, RED
from tasks.pictures.product import opened_cube
from tasks.pictures.sheet import Bar, Extent, Sheet, coloured
from tasks.publish.cube import plane_values

if TYPE_CHECKING:
    import xarray as xr

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
CELL_PX = (330, 320)


def planes_figure(folder: Path) -> Sheet:
    """Eight panels, cut to the body: coordinates, angles, resolution, uncertainty of the latitude, flags."""
    with opened_cube(folder) as cube:
        part = cube.isel(_around_the_body(cube))
        sheet = Sheet(2, 4, CELL_PX, f"{cube.attrs['product']}: planes of the cube")
        for number, (name, label, colours) in enumerate(PANELS):
            _draw(sheet, number, plane_values(part, name), _extent(part), label, colours)
        _draw_flags(sheet, len(PANELS), plane_values(part, "quality"), _extent(part))
    return sheet


def _around_the_body(cube: "xr.Dataset") -> dict[str, slice]:
    """The body with a margin, not more pixels than the figure can show."""
    on_body = (plane_values(cube, "quality") & np.uint16(Quality.OFF_BODY)) == 0
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


def _draw(sheet: Sheet, number: int, values: NDArray, extent: Extent, label: str, colours: str) -> None:
    finite = values[np.isfinite(values)]
    low, high = (float(v) for v in np.percentile(finite, (0.5, HIGH_PERCENTILE))) if finite.size else (0.0, 1.0)
    bar = Bar(low, max(high, low + 1e-9), colours)
    sheet.panel(number, coloured(values, bar), extent, label if finite.size else f"{label}: unknown", bar)


def _draw_flags(sheet: Sheet, number: int, quality: NDArray, extent: Extent) -> None:
    kind = np.full(quality.shape, len(KINDS) - 1)
    for place, (_, _, flags) in reversed(list(enumerate(KINDS[:-1]))):
        kind[(quality & np.uint16(flags)) != 0] = place
    colours = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for _, colour, _ in KINDS], np.uint8)
    sheet.panel(number, colours[kind], extent, "flags", legend=[(name, colour) for name, colour, _ in KINDS])
