"""How PDS3 labels describe arrays: sample types, storage orders, cubes' axes, and special values."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from catalog.errors import RefusedError
from catalog.readers.label_values import items, number
from catalog.readers.raw_array import Order, RawArray
from catalog.readers.reading import unreadable
from catalog.reasons import Reason

ORDERS: dict[str, Order] = {
    "BAND_SEQUENTIAL": "band", "BAND SEQUENTIAL": "band", "LINE_INTERLEAVED": "line", "LINE INTERLEAVED": "line",
    "SAMPLE_INTERLEAVED": "sample", "SAMPLE INTERLEAVED": "sample",
}  # fmt: skip
AXES: dict[tuple[str, ...], Order] = {
    ("SAMPLE", "LINE", "BAND"): "band",
    ("SAMPLE", "BAND", "LINE"): "line",
    ("BAND", "SAMPLE", "LINE"): "sample",
}
GIVE_PLAIN = "Give an uncompressed image of whole numbers or reals."


def sample_kind(path: Path, kind: str, item_bytes: int) -> str:
    """numpy's or this package's name of a PDS sample type. Raises RefusedError for those that are no plain numbers."""
    name = kind.strip().strip("\"'").upper().replace(" ", "_")
    low = name.startswith(("LSB", "PC", "VAX"))
    order = "<" if low else ">"
    if (name.startswith("VAX") and "REAL" in name) or name in ("VAX_DOUBLE", "VAXG_REAL"):
        if name.startswith("VAXG") or item_bytes not in (4, 8):
            raise unreadable(path, f"its label gives samples of {item_bytes * 8} bits {name}", GIVE_PLAIN)
        return "vax-f" if item_bytes == 4 else "vax-d"
    if any(word in name for word in ("REAL", "FLOAT", "DOUBLE")) and item_bytes in (4, 8):
        return f"{order}f{item_bytes}"
    if "INTEGER" in name or name in ("UNSIGNED", "BYTE"):
        signed = "UNSIGNED" not in name and item_bytes > 1
        if item_bytes in (1, 2, 4, 8):
            return f"{order}{'i' if signed else 'u'}{item_bytes}"
    raise unreadable(path, f"its label gives samples of {item_bytes * 8} bits {name}", GIVE_PLAIN)


def image_array(path: Path, keywords: Mapping[str, Any], offset: int) -> RawArray:
    """The array of an object IMAGE whose samples begin at byte `offset`. Raises RefusedError for others
    than plain numbers."""
    coded = str(keywords.get("ENCODING_TYPE") or "N/A").upper()
    if coded not in ("N/A", "NONE", "NULL", "UNCOMPRESSED"):
        raise RefusedError(Reason.IMAGE_COMPRESSED, f"image {path}: its samples are coded ({coded}).", GIVE_PLAIN)
    bits = _count(path, keywords, "SAMPLE_BITS")
    if bits not in (8, 16, 32, 64):
        raise unreadable(path, f"its label gives samples of {bits} bits", GIVE_PLAIN)
    storage = str(keywords.get("BAND_STORAGE_TYPE") or "BAND_SEQUENTIAL").upper()
    bands = _count(path, keywords, "BANDS", 1)
    if storage not in ORDERS and bands > 1:
        raise unreadable(path, f"its label gives BAND_STORAGE_TYPE = {storage}", GIVE_PLAIN)
    return RawArray(
        offset=offset,
        lines=_count(path, keywords, "LINES"),
        samples=_count(path, keywords, "LINE_SAMPLES"),
        kind=sample_kind(path, str(keywords.get("SAMPLE_TYPE", "UNSIGNED_INTEGER")), bits // 8),
        bands=bands,
        order=ORDERS.get(storage, "band"),
        prefix_bytes=_count(path, keywords, "LINE_PREFIX_BYTES", 0),
        suffix_bytes=_count(path, keywords, "LINE_SUFFIX_BYTES", 0),
    )


def cube_array(path: Path, keywords: Mapping[str, Any], offset: int) -> RawArray:
    """The array of an object QUBE, a cube of ISIS2 whose samples begin at byte `offset`. Raises RefusedError for others
    than plain numbers."""
    axes = tuple(str(name).upper() for name in items(keywords.get("AXIS_NAME")))
    sizes = items(keywords.get("CORE_ITEMS"))
    suffixes = items(keywords.get("SUFFIX_ITEMS", [0, 0, 0]))
    if axes not in AXES or len(sizes) != 3 or not all(type(size) is int for size in [*sizes, *suffixes]):
        raise unreadable(path, f"its label gives a cube of axes {axes} and sizes {sizes}")
    size, suffix = dict(zip(axes, sizes, strict=True)), dict(zip(axes, suffixes, strict=False))
    if (AXES[axes] != "band" and any(suffixes)) or any(
        suffix.get(axis) for axis in ("LINE", "BAND") if size["BAND"] > 1
    ):
        raise unreadable(path, f"its label gives suffixes {suffixes} of several bands", GIVE_PLAIN)
    item_bytes = _count(path, keywords, "CORE_ITEM_BYTES")
    return RawArray(
        offset=offset,
        lines=size["LINE"],
        samples=size["SAMPLE"],
        kind=sample_kind(path, str(keywords.get("CORE_ITEM_TYPE")), item_bytes),
        bands=size["BAND"],
        order=AXES[axes],
        suffix_bytes=suffix.get("SAMPLE", 0) * _count(path, keywords, "SUFFIX_BYTES", 4),
    )


def _count(path: Path, keywords: Mapping[str, Any], key: str, usual: int | None = None) -> int:
    value = keywords.get(key, usual)
    value = getattr(value, "value", value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise unreadable(path, f"its label gives {key} = {value!r}, a whole number is needed")
    return value


def special_value(value: Any, dtype: np.dtype[Any]) -> Any:
    """A special value of a label as a number of the samples' type: a number, or bits such as 16#FF7FFFFB#; None where
    it says nothing."""
    value = getattr(value, "value", value)
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, str):
        match = re.fullmatch(r"\s*(?:16#|0x)([0-9A-Fa-f]{1,16})#?\s*", value)
        if match is None:
            stated = number({"value": value}, "value")
            return None if stated is None else special_value(stated, dtype)
        value = int(match.group(1), 16)
    if dtype.kind == "f" and isinstance(value, int) and value > 0x7F800000:  # the bits of a real number
        size = 4 if value < 1 << 32 else 8  # bits of a 4-byte real, also where the samples have 8
        return np.frombuffer(value.to_bytes(8, "big")[-size:], f">f{size}")[0] if value < 1 << 64 else None
    if dtype.kind in "iu":
        limits = np.iinfo(dtype)
        return int(value) if value == int(value) and limits.min <= value <= limits.max else None
    return value
