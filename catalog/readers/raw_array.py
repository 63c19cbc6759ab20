"""Uncompressed arrays as a label describes them: ISIS cubes, PDS3 and PDS4 images.

The labels are read by kept libraries; the samples are cut out here with numpy, because GDAL's and pds4_tools' drivers
follow paths that a label names, take its sizes on trust and leave out line prefixes.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from catalog.readers.reading import MAX_PIXELS, bytes_at, checked_shape, unreadable

Order = Literal["band", "line", "sample"]
MAX_BANDS = 10_000
DISK_BLOCK_BYTES = 512
ENDS_OF_LINE = (b"\r\n", b"\n", b"\r", b"\x1a")  # what editors and transfers add to a file
VAX_KINDS = {"vax-f": 4, "vax-d": 8}  # numbers that numpy does not know


@dataclass(frozen=True)
class RawArray:
    """Where the samples are. kind: numpy's name of the sample's type (`>i2`), or `vax-f`, `vax-d`. order: what is
    stored as a whole: bands after each other, or in each line its samples of all bands, or in each pixel. prefix_bytes,
    suffix_bytes: around every stored line (order band: of one band, else of all bands). tile: (lines, samples) of
    tiles, whose last ones are stored whole."""

    offset: int
    lines: int
    samples: int
    kind: str
    bands: int = 1
    order: Order = "band"
    prefix_bytes: int = 0
    suffix_bytes: int = 0
    tile: tuple[int, int] | None = None

    @property
    def item_bytes(self) -> int:
        """Bytes of a sample."""
        return VAX_KINDS.get(self.kind) or np.dtype(self.kind).itemsize

    @property
    def line_bytes(self) -> int:
        """Bytes of a stored line with its prefix and suffix."""
        values = self.samples * (1 if self.order == "band" else self.bands)
        return self.prefix_bytes + values * self.item_bytes + self.suffix_bytes

    @property
    def padded(self) -> tuple[int, int]:
        """Lines and samples as stored: up to whole tiles."""
        if self.tile is None:
            return self.lines, self.samples
        return (-(-self.lines // self.tile[0]) * self.tile[0], -(-self.samples // self.tile[1]) * self.tile[1])

    @property
    def band_bytes(self) -> int:
        """Bytes of one band where bands are stored after each other."""
        if self.tile is None:
            return self.lines * self.line_bytes
        return self.padded[0] * self.padded[1] * self.item_bytes

    @property
    def end(self) -> int:
        """The byte after the last sample."""
        if self.order == "band":
            return self.offset + self.bands * self.band_bytes
        return self.offset + self.lines * self.line_bytes

    def with_lines(self, lines: int) -> "RawArray":
        """Copy with another number of lines."""
        return replace(self, lines=lines)


def check_array(path: Path, array: RawArray) -> None:
    """Refuse an array that is no picture of a sane size, or that the file does not hold; nothing is allocated."""
    checked_shape(path, array.lines, array.samples)
    if not 1 <= array.bands <= MAX_BANDS:
        raise unreadable(path, f"its label gives {array.bands} bands")
    if min(array.prefix_bytes, array.suffix_bytes, array.offset) < 0:
        raise unreadable(path, "its label gives a negative place or length")
    if array.tile is not None:
        if min(array.tile) < 1 or array.padded[0] * array.padded[1] > 2 * MAX_PIXELS:
            raise unreadable(path, f"its label gives tiles of {array.tile[1]} samples by {array.tile[0]} lines")
        if array.order != "band":
            raise unreadable(path, "its label gives tiles of interleaved bands")
    size = path.stat().st_size
    if array.end > size:
        raise unreadable(path, f"truncated: its pixels should reach byte {array.end}, the file has {size}")


def read_band(path: Path, array: RawArray, band: int) -> NDArray[Any]:
    """Samples (lines, samples) of a band, counted from 0. Raises RefusedError as `check_array`."""
    check_array(path, array)
    if array.tile is not None:
        return _tiled(path, array, band)
    if array.order == "band":
        raw = bytes_at(path, array.offset + band * array.band_bytes, array.band_bytes, "its last line")
        return _numbers(_bodies(raw, array, array.samples), array.kind).reshape(array.lines, array.samples)
    picked = np.empty((array.lines, array.samples * array.item_bytes), np.uint8)
    wide = array.samples * array.item_bytes
    at_once = max(1, 30_000_000 // max(array.line_bytes, 1))
    for first in range(0, array.lines, at_once):
        part = array.with_lines(min(at_once, array.lines - first))
        raw = bytes_at(path, array.offset + first * array.line_bytes, part.lines * array.line_bytes, "its last line")
        bodies = _bodies(raw, part, array.samples * array.bands)
        if array.order == "line":
            picked[first : first + part.lines] = bodies[:, band * wide : (band + 1) * wide]
        else:
            pixels = bodies.reshape(part.lines, array.samples, array.bands, array.item_bytes)
            picked[first : first + part.lines] = pixels[:, :, band].reshape(part.lines, wide)
    return _numbers(picked, array.kind).reshape(array.lines, array.samples)


def _bodies(raw: bytes, array: RawArray, values: int) -> NDArray[np.uint8]:
    """The stored lines without prefixes and suffixes (lines, bytes)."""
    records = np.frombuffer(raw, np.uint8).reshape(array.lines, array.line_bytes)
    return records[:, array.prefix_bytes : array.prefix_bytes + values * array.item_bytes]


def _tiled(path: Path, array: RawArray, band: int) -> NDArray[Any]:
    high, wide = array.tile or (1, 1)
    lines, samples = array.padded
    raw = bytes_at(path, array.offset + band * array.band_bytes, array.band_bytes, "its last tile")
    tiles = _numbers(np.frombuffer(raw, np.uint8), array.kind)
    picture = tiles.reshape(lines // high, samples // wide, high, wide).swapaxes(1, 2).reshape(lines, samples)
    return np.ascontiguousarray(picture[: array.lines, : array.samples])


def _numbers(body: NDArray[np.uint8], kind: str) -> NDArray[Any]:
    body = np.ascontiguousarray(body).reshape(-1)
    if kind in VAX_KINDS:
        import vax

        with np.errstate(all="ignore"):
            return np.asarray((vax.from_vax32 if kind == "vax-f" else vax.from_vax64)(body))
    return body.view(kind)


def check_end(path: Path, end: int, record_bytes: int = 1, known_bytes: int | None = None) -> None:
    """Refuse a file in which bytes were lost or put in, so that the picture is shifted. end: where the last thing that
    the label places ends. known_bytes: the file's size as the label gives it.

    A file of the size in the label is sound, also with an end of line that was added, and so is one that ends with its
    last thing, at a disk block, or after whole records.
    """
    size = path.stat().st_size
    added = added_end_of_line(path, end)
    if any(_is_sound(whole, end, record_bytes, known_bytes) for whole in (size, size - added)):
        return
    raise unreadable(path, f"what its label places should end at byte {end} of {size}: bytes were lost or put in")


def added_end_of_line(path: Path, end: int) -> int:
    """Bytes of the end of line with which a file ends, 0 where it has none behind byte `end`."""
    size = path.stat().st_size
    tail = bytes_at(path, max(size - 2, end), min(2, size - end), "its end") if size > end else b""
    return next((len(mark) for mark in ENDS_OF_LINE if tail.endswith(mark)), 0)


def _is_sound(size: int, end: int, record_bytes: int, known_bytes: int | None) -> bool:
    beyond = size - end
    whole_records = record_bytes > 1 and beyond % record_bytes == 0
    return beyond == 0 or (beyond > 0 and (size == known_bytes or size % DISK_BLOCK_BYTES == 0 or whole_records))
