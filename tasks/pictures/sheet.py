"""Sheets of picture panels with pixel axes and colour bars, drawn by Pillow and OpenCV.

A report draws two of them for every image of a store. Matplotlib takes 2.5 s of a processor for the two, most of it for
its layout and text; figures that are drawn once per store are still made by it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]
Extent = tuple[float, float, float, float]  # left, right, lower and upper edge, frame pixels; as in matplotlib
Colour = tuple[int, int, int]

TEXT_PX, SMALL_PX, HEAD_PX = 13, 11, 16
LEFT_PX, TOP_PX, BELOW_PX, RIGHT_PX, HEADING_PX = 46, 26, 26, 14, 30
BAR_PX, BAR_GAP_PX, BAR_TEXT_PX, ARROW_PX = 11, 9, 46, 9
MOST_TICKS = 5
LINE_POINTS = 0.7
BLACK, GREY, WHITE = (0, 0, 0), (110, 110, 110), (255, 255, 255)
COMPRESSION = 4  # of PNG: a sixth larger than at 9 and three times as quick


@dataclass(frozen=True)
class Bar:
    """A colour bar. ends: whether values below and above are shown in the colours of its ends."""

    low: float
    high: float
    colours: str
    ends: tuple[bool, bool] = (False, True)
    label: str = ""


@dataclass(frozen=True)
class Curve:
    """A line of frame pixels (n, 2)."""

    xy: NDArray[np.float64]
    colour: str
    dashed: bool = False


class Sheet:
    """Panels of `cell_px` (width, height) in rows and columns under a heading."""

    def __init__(self, rows: int, columns: int, cell_px: tuple[int, int], heading: str) -> None:
        from PIL import Image, ImageDraw

        self._columns, self._cell = columns, cell_px
        self._image = Image.new("RGB", (cell_px[0] * columns, cell_px[1] * rows + HEADING_PX), WHITE)
        self._draw = ImageDraw.Draw(self._image)
        place = (self._image.width / 2, HEADING_PX / 2)
        self._draw.text(place, heading, fill=BLACK, font=font(HEAD_PX), anchor="mm")

    def panel(
        self,
        number: int,
        pixels: Pixels,
        extent: Extent,
        title: str,
        bar: Bar | None = None,
        curves: Sequence[Curve] = (),
        legend: Sequence[tuple[str, str]] = (),
    ) -> None:
        """Draw pixels (ny, nx, 3), whose first row is the upper one, into the panel `number` in reading order. legend:
        names and colours, shown below."""
        from PIL import Image

        row, column = divmod(number, self._columns)
        right_px = RIGHT_PX if bar is None else BAR_GAP_PX + BAR_PX + BAR_TEXT_PX
        below_px = BELOW_PX + (TEXT_PX + 4) * -(-len(legend) // 2)
        width, height = self._cell[0] - LEFT_PX - right_px, self._cell[1] - TOP_PX - below_px
        scale = min(width / (extent[1] - extent[0]), height / (extent[2] - extent[3]))
        size = max(round(scale * (extent[1] - extent[0])), 2), max(round(scale * (extent[2] - extent[3])), 2)
        x0 = self._cell[0] * column + LEFT_PX + (width - size[0]) // 2
        y0 = HEADING_PX + self._cell[1] * row + TOP_PX + (height - size[1]) // 2
        box = (x0, y0, x0 + size[0], y0 + size[1])
        self._image.paste(Image.fromarray(with_curves(pixels, size, extent, curves)), (x0, y0))
        self._draw.rectangle((x0 - 1, y0 - 1, box[2], box[3]), outline=BLACK)
        self._draw.text(((x0 + box[2]) / 2, y0 - 6), title, fill=BLACK, font=font(TEXT_PX), anchor="mb")
        self._axes(box, extent)
        if bar is not None:
            self._bar(box, bar)
        for place, (name, colour) in enumerate(legend):
            self._legend_entry(box, place, name, colour)

    def save(self, path: Path) -> None:
        """Write a PNG."""
        self._image.save(path, format="PNG", compress_level=COMPRESSION)

    def _axes(self, box: tuple[int, int, int, int], extent: Extent) -> None:
        from tasks.publish.drawing import ticks

        x0, y0, x1, y1 = box
        for value in ticks(extent[0], extent[1], MOST_TICKS):
            x = x0 + (value - extent[0]) / (extent[1] - extent[0]) * (x1 - x0)
            self._draw.line((x, y1, x, y1 + 4), fill=BLACK)
            self._draw.text((x, y1 + 6), f"{value:g}", fill=BLACK, font=font(SMALL_PX), anchor="mt")
        for value in ticks(extent[3], extent[2], MOST_TICKS):
            y = y0 + (value - extent[3]) / (extent[2] - extent[3]) * (y1 - y0)
            self._draw.line((x0 - 5, y, x0 - 1, y), fill=BLACK)
            self._draw.text((x0 - 7, y), f"{value:g}", fill=BLACK, font=font(SMALL_PX), anchor="rm")

    def _bar(self, box: tuple[int, int, int, int], bar: Bar) -> None:
        from PIL import Image

        from tasks.publish.drawing import ticks

        x0, x1 = box[2] + BAR_GAP_PX, box[2] + BAR_GAP_PX + BAR_PX
        y0, y1 = box[1] + ARROW_PX, box[3] - ARROW_PX
        if y1 - y0 < 2:
            return
        colours = colour_table(bar.colours)
        shades = np.linspace(255, 0, y1 - y0).round().astype(int)
        self._image.paste(Image.fromarray(np.repeat(colours[shades][:, None], BAR_PX, axis=1)), (x0, y0))
        outline = [(x0, y1), (x1, y1), (x1, y0), (x0, y0)]
        for there, y, tip, colour in zip(
            bar.ends, (y1, y0), (y1 + ARROW_PX, y0 - ARROW_PX), colours[[0, 255]], strict=True
        ):
            if there:
                corners = [(x0, y), ((x0 + x1) / 2, tip), (x1, y)]
                self._draw.polygon(corners, fill=tuple(map(int, colour)), outline=BLACK)
        self._draw.polygon(outline, outline=BLACK)
        for value in ticks(bar.low, bar.high, MOST_TICKS):
            place = y1 - (value - bar.low) / (bar.high - bar.low) * (y1 - y0)
            self._draw.line((x1, place, x1 + 3, place), fill=BLACK)
            self._draw.text((x1 + 5, place), f"{value:g}", fill=BLACK, font=font(SMALL_PX), anchor="lm")
        if bar.label:
            self._draw.text((x1 + 4, box[3] + 6), bar.label, fill=BLACK, font=font(SMALL_PX), anchor="mt")

    def _legend_entry(self, box: tuple[int, int, int, int], place: int, name: str, colour: str) -> None:
        row, column = divmod(place, 2)
        x = box[0] + column * (box[2] - box[0]) // 2
        y = box[3] + BELOW_PX + row * (TEXT_PX + 4)
        self._draw.rectangle((x, y, x + 18, y + 9), fill=colour, outline=GREY)
        self._draw.text((x + 24, y + 5), name, fill=BLACK, font=font(SMALL_PX), anchor="lm")


def coloured(values: NDArray[Any], bar: Bar, unknown: Colour = WHITE) -> Pixels:
    """Values (ny, nx) in the bar's colours, those that are not finite in `unknown`."""
    known = np.isfinite(values)
    share = (np.where(known, values, bar.low) - bar.low) / max(bar.high - bar.low, 1e-300)
    shown = colour_table(bar.colours)[np.clip(255.999 * share, 0, 255).astype(np.uint8)]
    return np.where(known[..., None], shown, np.array(unknown, np.uint8))


def with_curves(pixels: Pixels, size: tuple[int, int], extent: Extent, curves: Sequence[Curve]) -> Pixels:
    """The pixels enlarged or reduced to `size` (width, height), with lines of frame pixels over them."""
    import cv2

    from tasks.publish.drawing import draw_line

    drawn = cv2.resize(np.ascontiguousarray(pixels), size, interpolation=cv2.INTER_NEAREST)
    scale = np.array([size[0] / (extent[1] - extent[0]), size[1] / (extent[2] - extent[3])])
    for curve in curves:
        style = {"color": curve.colour, "linewidth": LINE_POINTS, "linestyle": "--" if curve.dashed else "-"}
        draw_line(drawn, (curve.xy - (extent[0], extent[3])) * scale - 0.5, style)
    return np.asarray(drawn)


@cache
def colour_table(name: str) -> Pixels:
    """The 256 colours (256, 3) of a colour map of matplotlib."""
    from matplotlib import colormaps

    return np.asarray((colormaps[name](np.arange(256))[:, :3] * 255).round(), np.uint8)


@cache
def font(size_px: int) -> Any:
    """Pillow's own font, which is where Pillow is."""
    from PIL import ImageFont

    return ImageFont.load_default(size_px)
