"""Curves, ticks and text over an image: OpenCV's anti-aliased lines and Pillow's text.

Every corrected image gets a picture; matplotlib takes three times as long for it, and a second to be imported.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageColor, ImageDraw, ImageFont

from tasks.publish.framing import Box

DPI = 110
PNG_LEVEL = 3  # in two thirds of the time as small as the usual 6
BEHIND = "#202020"  # of a panel where no image is
SHARP = 3.0  # magnification from which the image's pixels are shown as squares
SHIFT = 4  # binary digits of a fraction of a pixel in OpenCV's coordinates
FAR_PX = 20000.0  # farther points of a curve are drawn at this distance
MOST_TICKS = 8
TICK_PX = 5

Rgb = tuple[int, int, int]
Points = NDArray[np.float64]
Style = Mapping[str, Any]
"""color, linewidth (points), alpha, linestyle ("-", "--", ":", or matplotlib's (offset, (on, off)) in linewidths)."""


class Picture:
    """A white canvas of width x height pixels; text is drawn last, by `save`."""

    def __init__(self, width: int, height: int) -> None:
        self.rgb = np.full((height, width, 3), 255, np.uint8)
        self._texts: list[tuple[tuple[float, float], str, dict[str, Any]]] = []

    def text(
        self, xy: tuple[float, float], text: str, points: float, anchor: str = "mm", color: str = "black", halo: int = 0
    ) -> None:
        """Text at a pixel of the canvas; `anchor` as Pillow has it; `halo`: pixels of black around the letters."""
        font = ImageFont.load_default(pixels(points))
        style = {
            "font": font,
            "fill": color,
            "anchor": anchor,
            "stroke_width": halo,
            "stroke_fill": "#303030",
            "align": "center",
        }
        self._texts.append((xy, text, style))

    def legend(self, entries: Sequence[tuple[str, Style]], bottom: float) -> None:
        """Line and name of each entry, in one row above `bottom`, in the canvas' middle."""
        font, gap, sample = ImageFont.load_default(pixels(9)), 14, 34
        widths = [sample + 8 + font.getlength(name) for name, _ in entries]
        left = (self.rgb.shape[1] - sum(widths) - gap * (len(entries) - 1)) / 2
        low, high = (int(bottom - 26), int(bottom))
        x0, x1 = int(left - gap), int(left + sum(widths) + gap * len(entries))
        cv2.rectangle(self.rgb, (x0, low), (x1, high), rgb("#333333"), -1)
        for (name, style), width in zip(entries, widths, strict=True):
            middle = (low + high) / 2
            draw_line(self.rgb, np.array([[left, middle], [left + sample, middle]]), style)
            self.text((left + sample + 8, middle), name, 9, "lm", "white")
            left += width + gap

    def save(self, path: Path) -> None:
        """Write the canvas as PNG."""
        picture = Image.fromarray(self.rgb)
        draw = ImageDraw.Draw(picture)
        for xy, text, style in self._texts:
            draw.text(xy, text, **style)
        picture.save(path, format="PNG", dpi=(DPI, DPI), compress_level=PNG_LEVEL)


class Panel:
    """The part `box` of a frame, drawn into the picture's rectangle at left, top, of at most size = (width, height)."""

    def __init__(self, picture: Picture, box: Box, left: int, top: int, size: tuple[int, int]) -> None:
        self.picture, self.left, self.top = picture, left, top
        # Edges on edges of pixels, so that a cut-out of the image fills the panel.
        self.x0, self.y0 = (np.floor(v + 0.5) - 0.5 for v in (box.x0, box.y0))
        self.columns, self.rows = (
            max(1, round(v)) for v in (np.ceil(box.x1 + 0.5) - 0.5 - self.x0, np.ceil(box.y1 + 0.5) - 0.5 - self.y0)
        )
        self.scale = min(size[0] / self.columns, size[1] / self.rows)
        self.width, self.height = (max(1, round(n * self.scale)) for n in (self.columns, self.rows))
        self.area = picture.rgb[top : top + self.height, left : left + self.width]
        self.area[:] = rgb(BEHIND)

    def at(self, xy_px: Points) -> Points:
        """Pixels (..., 2) of the panel, of pixels of the frame."""
        return (np.asarray(xy_px) - (self.x0, self.y0)) * self.scale - 0.5

    def image(self, shown: NDArray[np.float32]) -> None:
        """Grey values 0-1 of the whole frame (ny, nx)."""
        x, y = round(self.x0 + 0.5), round(self.y0 + 0.5)
        seen = shown[max(y, 0) : y + self.rows, max(x, 0) : x + self.columns]
        if not seen.size:
            return
        left, top = (round(max(-v, 0) * self.scale) for v in (x, y))
        width = min(max(1, round(seen.shape[1] * self.scale)), self.width - left)
        height = min(max(1, round(seen.shape[0] * self.scale)), self.height - top)
        how = cv2.INTER_NEAREST if self.scale >= SHARP else cv2.INTER_LINEAR if self.scale > 1 else cv2.INTER_AREA
        grey = cv2.resize(np.rint(255 * seen).astype(np.uint8), (width, height), interpolation=how)
        self.area[top : top + height, left : left + width] = grey[..., None]

    def curves(self, curves_px: Sequence[Points], style: Style, edge: tuple[float, float] | None = None) -> None:
        """Curves (n, 2) of pixels of the frame, interrupted at NaN; `edge`: linewidth and alpha of black under them."""
        places = [self.at(curve) for curve in curves_px]
        if edge:
            self._draw(places, {**style, "color": "black", "linewidth": edge[0], "alpha": edge[1]})
        self._draw(places, style)

    def _draw(self, places: Sequence[Points], style: Style) -> None:
        alpha = float(style.get("alpha", 1.0))
        onto = self.area if alpha >= 1 else self.area.copy()
        for place in places:
            draw_line(onto, place, style)
        if alpha < 1:
            cv2.addWeighted(onto, alpha, self.area, 1 - alpha, 0, dst=self.area)

    def label(self, text: str, xy_px: tuple[float, float], shift_points: tuple[float, float]) -> None:
        """White text beside a pixel of the frame, where that is in the panel."""
        x, y = self.at(np.array(xy_px))
        if 0 <= x < self.width and 0 <= y < self.height:
            shift = [v * DPI / 72 for v in shift_points]
            self.picture.text((self.left + x + shift[0], self.top + y - shift[1]), text, 7, color="white", halo=1)

    def axes(self) -> None:
        """A border, and the frame's pixels along it."""
        rgb_, (left, top) = self.picture.rgb, (self.left, self.top)
        bottom, right = top + self.height, left + self.width
        cv2.rectangle(rgb_, (left - 1, top - 1), (right, bottom), (0, 0, 0), 1)
        for value in ticks(self.x0, self.x0 + self.columns):
            x = left + (value - self.x0) * self.scale - 0.5
            cv2.line(rgb_, (round(x), bottom), (round(x), bottom + TICK_PX), (0, 0, 0), 1)
            self.picture.text((x, bottom + TICK_PX + 3), f"{value:g}", 8, "mt")
        for value in ticks(self.y0, self.y0 + self.rows):
            y = top + (value - self.y0) * self.scale - 0.5
            cv2.line(rgb_, (left - TICK_PX, round(y)), (left, round(y)), (0, 0, 0), 1)
            self.picture.text((left - TICK_PX - 3, y), f"{value:g}", 8, "rm")
        self.picture.text(((left + right) / 2, bottom + TICK_PX + 20), "x, y (px)", 8, "mt")


def draw_line(onto: NDArray[np.uint8], points: Points, style: Style) -> None:
    """A line through canvas pixels (n, 2), interrupted at NaN, into (ny, nx, 3) in place; `alpha` is the caller's."""
    width = max(1, pixels(float(style["linewidth"])))
    dashes = pattern(style.get("linestyle", "-"), float(style["linewidth"]))
    lines = [piece for part in unbroken(points) for piece in (dashed(part, dashes) if dashes else [part])]
    fixed = [np.rint(np.clip(line, -FAR_PX, FAR_PX) * 2**SHIFT).astype(np.int32) for line in lines]
    cv2.polylines(onto, fixed, False, rgb(str(style["color"])), width, cv2.LINE_AA, SHIFT)


def unbroken(points: Points) -> list[Points]:
    """The pieces of a curve (n, 2) between its NaN."""
    good = np.isfinite(points).all(axis=1)
    cuts = np.flatnonzero(np.diff(good.astype(np.int8))) + 1
    return [part for part in np.split(points, cuts) if len(part) > 1 and np.isfinite(part).all()]


def dashed(points: Points, pattern_px: Sequence[float]) -> list[Points]:
    """The drawn pieces of a line (n, 2) by lengths on, off, on, off ... in pixels."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    period = float(sum(pattern_px))
    starts, pieces = np.concatenate([[0.0], np.cumsum(pattern_px)[:-1]]), []
    if not 0 < along[-1] < FAR_PX:
        return [points]
    for begin in np.arange(0.0, along[-1], period):
        for start, length in zip(starts[::2], pattern_px[::2], strict=True):
            low, high = begin + start, min(begin + start + length, along[-1])
            if low < high:
                inside = along[(along > low) & (along < high)]
                where = np.concatenate([[low], inside, [high]])
                pieces.append(np.stack([np.interp(where, along, points[:, k]) for k in (0, 1)], axis=1))
    return pieces


def pattern(linestyle: Any, linewidth: float) -> tuple[float, ...]:
    """Lengths on, off ... in pixels; none for a full line. Matplotlib's dashes are in linewidths."""
    named = {"-": (), "--": (3.7, 1.6), ":": (1.0, 1.65)}
    lengths = named[linestyle] if isinstance(linestyle, str) else linestyle[1]
    return tuple(float(v) * linewidth * DPI / 72 for v in lengths)


def ticks(low: float, high: float, most: int = MOST_TICKS) -> list[float]:
    """Round numbers between low and high in steps of 1, 2 or 5, about `most`; none where that is no interval."""
    least = (high - low) / most
    if not (np.isfinite(least) and least > 0):
        return []
    decade = 10.0 ** np.floor(np.log10(least))
    step = next(k * decade for k in (1, 2, 5, 10) if k * decade >= least * 0.999)
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(f"{number * step:.12g}") for number in np.arange(first, last + 1) + 0.0]


def pixels(points: float) -> int:
    """Pixels of a length in points, 1/72 inch."""
    return round(points * DPI / 72)


def rgb(color: str) -> Rgb:
    """Red, green, blue of a colour's name or #rrggbb."""
    return ImageColor.getrgb(color)[:3]
