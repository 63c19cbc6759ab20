"""The VICAR file format: label, binary header lines, line prefixes and pixels (VICAR File Format, JPL D-4186).

Of several bands, in each of the three orders (BSQ, BIL, BIP), one is read.

rms-vicar parses the label; the pixels are cut out here, because it refuses the two-dimensional labels (DIM=2) of the
1980s and relies on sizes that the file does not have.
"""

import re
import sys
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.readers.bands import chosen_plane
from catalog.readers.pds3_image import lines_by_label
from catalog.readers.raw_array import MAX_BANDS, added_end_of_line
from catalog.readers.reading import bytes_at, checked_shape, unreadable
from catalog.reasons import Reason

LABEL_START = re.compile(rb"LBLSIZE *= *(\d{1,9})\b")
MAX_LABEL_BYTES = 200_000
MAX_KEYWORDS = 3000  # the parser takes about a millisecond for each
MAX_ITEMS = 5000
DISK_BLOCK_BYTES = 512
PORTION_BYTES = 30_000_000
ORDERS = ("BSQ", "BIL", "BIP")
UNPACK = "Unpack it, for example by `gdal_translate -of VICAR`."
SAMPLE_BYTES = {"BYTE": 1, "HALF": 2, "WORD": 2, "FULL": 4, "LONG": 4, "REAL": 4, "DOUB": 8}
INTEGER_KINDS = {"BYTE": "u1", "HALF": "i2", "WORD": "i2", "FULL": "i4", "LONG": "i4"}


@dataclass(frozen=True)
class VicarLayout:
    """Where the pixels are: byte offsets and counts, all checked against the file's size. order: BSQ, a record holds a
    line of a band, band after band; BIL, the same, line after line; BIP, it holds a pixel's bands."""

    offset: int
    lines: int
    samples: int
    bands: int
    order: str
    record_bytes: int
    prefix_bytes: int
    kind: str
    little_endian: bool
    vax_float: bool

    @property
    def line_records(self) -> int:
        """Records of a line of all bands."""
        return self.samples if self.order == "BIP" else self.bands

    @property
    def end(self) -> int:
        """The byte after the last record."""
        return self.offset + self.lines * self.line_records * self.record_bytes


def read_vicar(path: Path, plane: str | None = None) -> tuple[dict[str, Any], NDArray[Any]]:
    """Label (first occurrence of each keyword) and pixels (lines, samples) of one band. plane: its number, from 1.

    Raises RefusedError when the label cannot be parsed, its sizes contradict the file, it holds no plain image, or
    several bands of which none is chosen.
    """
    text, label_bytes = _label_text(path, 0)
    label = _parsed(path, text)
    layout = _layout(path, label, label_bytes)
    layout = _as_long_as(path, layout)
    bytes_at(path, layout.end, 0, "the last image line")  # before anything is allocated
    pixels = _pixels(path, layout, chosen_plane(path, [""] * layout.bands, plane))
    end = layout.end
    continued = bool(_integer(path, label, "EOL", 0))
    _check_end(path, end, layout.record_bytes, continued)
    if continued:
        label = {**_extension(path, end), **label}
    return label, pixels


def _as_long_as(path: Path, layout: VicarLayout) -> VicarLayout:
    """The layout; of a file that ends before its last line, with the lines that the label beside it gives, if the file
    ends with the last of them."""
    size = path.stat().st_size
    if layout.end <= size or layout.bands > 1:
        return layout
    lines = lines_by_label(path)
    if lines is None or not 0 < lines < layout.lines:
        return layout
    shorter = replace(layout, lines=lines)
    return shorter if shorter.end == size else layout


def _check_end(path: Path, end: int, record_bytes: int, continued: bool) -> None:
    """Refuse a file in which bytes were lost or put in, so that the picture is shifted: behind the pixels must come the
    label's continuation, or nothing, or whole records, or what fills up disk blocks; an end of line may be added."""
    size = path.stat().st_size
    if size == end:
        return
    if continued:
        sound = LABEL_START.match(bytes_at(path, end, min(40, size - end), "its label's end")) is not None
    else:
        whole = (size, size - added_end_of_line(path, end))
        sound = any(each % DISK_BLOCK_BYTES == 0 or (each - end) % record_bytes == 0 for each in whole)
    if not sound:
        raise unreadable(path, f"its pixels should end at byte {end} of {size}: bytes were lost or put in on the way")


def _label_text(path: Path, offset: int) -> tuple[str, int]:
    head = bytes_at(path, offset, min(40, path.stat().st_size - offset), "its label")
    match = LABEL_START.match(head)
    if not match:
        raise unreadable(path, f"no VICAR label at byte {offset}")
    size = int(match.group(1))
    if not 0 < size <= MAX_LABEL_BYTES:
        raise unreadable(path, f"its label claims {size} bytes")
    raw = bytes_at(path, offset, size, "its label")
    return raw.partition(b"\0")[0].decode("latin-1"), size


@cache
def _label_parser() -> tuple[type[Exception], Any]:
    """VicarError and VicarLabel of rms-vicar. For files it imports rms-filecache, and that boto3, requests and Google's
    cloud storage: 0.4 s of a processor. We give it text only, and plain paths in their place."""
    files: Any = ModuleType("filecache")
    files.FCPath = Path
    is_known = "filecache" in sys.modules
    sys.modules.setdefault("filecache", files)
    try:
        from vicar import VicarError, VicarLabel
    finally:
        if not is_known:
            sys.modules.pop("filecache", None)
    return VicarError, VicarLabel


def _parsed(path: Path, text: str) -> dict[str, Any]:
    VicarError, VicarLabel = _label_parser()
    modern = re.sub(r"\bDIM *= *2\b", "DIM=3", text)
    if not modern.isprintable():
        raise unreadable(path, "its VICAR label holds control characters")
    bare = re.sub(r"'[^']*'", "''", modern)
    if bare.count("=") > MAX_KEYWORDS or bare.count(",") + len(modern.split("''")) > MAX_ITEMS:
        raise unreadable(path, f"its VICAR label has more than {MAX_KEYWORDS} keywords or {MAX_ITEMS} items")
    try:
        label = VicarLabel(modern, strict=False)
    except (VicarError, TypeError, ValueError, LookupError, ArithmeticError, RecursionError) as error:
        raise unreadable(path, f"its VICAR label cannot be parsed ({error})") from error
    flat: dict[str, Any] = {}
    for name, value in zip(label.names(), label.values(), strict=True):
        if name in modern:  # rms-vicar adds keywords that are missing, with this machine's number formats
            flat.setdefault(name, value)
    return flat


def _extension(path: Path, offset: int) -> dict[str, Any]:
    """The label's continuation behind the pixels (EOL=1); a file cut off there has lost nothing that is needed."""
    try:
        return _parsed(path, _label_text(path, offset)[0])
    except RefusedError:
        return {}


def _integer(path: Path, label: dict[str, Any], key: str, default: int | None = None) -> int:
    value = label.get(key, default)
    if not isinstance(value, int):
        raise unreadable(path, f"its VICAR label gives {key}={value!r}, a whole number is needed")
    return value


def _layout(path: Path, label: dict[str, Any], label_bytes: int) -> VicarLayout:
    kind = str(label.get("FORMAT", "")).upper()
    if kind not in SAMPLE_BYTES or not str(label.get("TYPE", "IMAGE")).upper().startswith("IMAG"):
        raise unreadable(path, f"a VICAR file of TYPE {label.get('TYPE')!r} and FORMAT {kind!r} is no plain image", "")
    packed = str(label.get("COMPRESS", "NONE")).upper()
    if packed != "NONE":
        raise RefusedError(Reason.IMAGE_COMPRESSED, f"image {path}: its samples are coded ({packed}).", UNPACK)
    bands, order = _integer(path, label, "NB", 1), str(label.get("ORG", "BSQ")).upper()
    if not 1 <= bands <= MAX_BANDS or order not in ORDERS:
        raise unreadable(path, f"its VICAR label gives {bands} bands in the order {order!r}")
    lines, samples = checked_shape(path, _integer(path, label, "NL"), _integer(path, label, "NS"))
    prefix = _integer(path, label, "NBB", 0)
    header_lines = _integer(path, label, "NLB", 0)
    record = _integer(path, label, "RECSIZE")
    items = bands if order == "BIP" else samples
    if prefix < 0 or header_lines < 0 or record < prefix + items * SAMPLE_BYTES[kind]:
        raise unreadable(path, f"records of {record} bytes cannot hold {prefix} prefix bytes and {items} samples")
    little = label.get("INTFMT", "LOW") != "HIGH" if kind in INTEGER_KINDS else label.get("REALFMT", "VAX") != "IEEE"
    vax = kind not in INTEGER_KINDS and label.get("REALFMT", "VAX") == "VAX"
    offset = label_bytes + header_lines * record
    return VicarLayout(offset, lines, samples, bands, order, record, prefix, kind, little, vax)


def _pixels(path: Path, layout: VicarLayout, band: int) -> NDArray[Any]:
    item_bytes = SAMPLE_BYTES[layout.kind]
    body = np.empty((layout.lines, layout.samples * item_bytes), np.uint8)
    if layout.order == "BSQ":
        first, line_records, band = layout.offset + band * layout.lines * layout.record_bytes, 1, 0
    else:
        first, line_records = layout.offset, layout.line_records
    line_bytes = line_records * layout.record_bytes
    items = layout.bands if layout.order == "BIP" else layout.samples
    at_once = max(1, PORTION_BYTES // line_bytes)
    for line in range(0, layout.lines, at_once):
        count = min(at_once, layout.lines - line)
        raw = bytes_at(path, first + line * line_bytes, count * line_bytes, "the last image line")
        records = np.frombuffer(raw, np.uint8).reshape(count, line_records, layout.record_bytes)
        values = records[:, :, layout.prefix_bytes : layout.prefix_bytes + items * item_bytes]
        bytes_of_band = slice(band * item_bytes, (band + 1) * item_bytes)
        values = values[:, :, bytes_of_band] if layout.order == "BIP" else values[:, band]
        body[line : line + count] = values.reshape(count, -1)
    if layout.vax_float:
        import vax

        convert = vax.from_vax32 if layout.kind == "REAL" else vax.from_vax64
        return convert(body.reshape(-1)).reshape(layout.lines, layout.samples)
    order = "<" if layout.little_endian else ">"
    kind = INTEGER_KINDS.get(layout.kind) or ("f4" if layout.kind == "REAL" else "f8")
    return body.view(order + kind)
