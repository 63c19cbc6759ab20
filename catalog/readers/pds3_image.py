"""PDS3 images that are no VICAR, and ISIS2 cubes: with the label in front or beside, as the PDS Standards Reference 3.8
(appendix A.20, IMAGE; A.21, QUBE; appendix C, sample types) describes them.

Read are samples of 8 to 64 bits in every byte order, line prefixes and suffixes, bands in every order, and the scaling
OFFSET + SCALING_FACTOR * stored. 8-bit samples count as unsigned whatever SAMPLE_TYPE says, as in ISIS and GDAL: labels
of unsigned images say SUN_INTEGER. Lines come in the file's order, whatever LINE_DISPLAY_DIRECTION is.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.detached import data_beside, label_beside
from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers.bands import chosen_plane
from catalog.readers.bounded_pvl import MAX_LABEL_BYTES, load_pvl
from catalog.readers.gaps import zero_filled
from catalog.readers.isis import special_pixels
from catalog.readers.keywords import facts_of_keywords, flat, plain_values
from catalog.readers.label_values import items, number, plain_label
from catalog.readers.raw_array import MAX_BANDS, Order, RawArray, check_array, check_end, read_band
from catalog.readers.reading import Reading, unreadable
from catalog.regular_file import open_regular

START = re.compile(rb"\s*(?:PDS_VERSION_ID|CCSD3ZF)")
END = re.compile(r"(?m)^[ \t]*END[ \t]*\r?$")
QUBES = ("QUBE", "SPECTRAL_QUBE", "ISIS2_QUBE")
ORDERS: dict[str, Order] = {
    "BAND_SEQUENTIAL": "band", "BAND SEQUENTIAL": "band", "LINE_INTERLEAVED": "line", "LINE INTERLEAVED": "line",
    "SAMPLE_INTERLEAVED": "sample", "SAMPLE INTERLEAVED": "sample",
}  # fmt: skip
AXES: dict[tuple[str, ...], Order] = {
    ("SAMPLE", "LINE", "BAND"): "band",
    ("SAMPLE", "BAND", "LINE"): "line",
    ("BAND", "SAMPLE", "LINE"): "sample",
}
MISSING_KEYS = (
    "MISSING_CONSTANT", "MISSING", "INVALID_CONSTANT", "INVALID", "NULL", "CORE_NULL", "CORE_LOW_REPR_SATURATION",
    "CORE_LOW_INSTR_SATURATION",
)  # fmt: skip
SATURATED_KEYS = ("SATURATED_CONSTANT", "CORE_HIGH_REPR_SATURATION", "CORE_HIGH_INSTR_SATURATION")
GIVE_PLAIN = "Give an uncompressed image of whole numbers or reals."


class Pds3Reader:
    """PDS3 images and ISIS2 cubes, by the file with the label or by the file with the pixels."""

    def recognises(self, head: bytes, path: Path) -> bool:
        """A PDS3 label begins the file, or lies beside it and names it as its image."""
        if START.match(head):
            return True
        beside = label_beside(path)
        return beside is not None and beside.suffix.lower() == ".lbl" and _describes(beside, path)

    def read(self, path: Path, plane: str | None = None) -> Reading:
        """Pixels and metadata of one band."""
        with open_regular(path) as file:
            attached = START.match(file.read(200)) is not None
        label_file = path if attached else label_beside(path) or path
        label = parsed_label(path, label_file)
        image = _image(path, label, label_file)
        if not attached and image.file != path:
            raise unreadable(path, f"its label {label_file.name} describes {image.file.name}")
        check_array(image.file, image.array)
        band = chosen_plane(path, image.names, plane)
        records = number(label, "FILE_RECORDS")
        known = None if records is None else int(records * image.record_bytes)
        check_end(image.file, image.array.end, image.record_bytes, known)
        stored = read_band(image.file, image.array, band)
        keywords = keywords_of(label)
        facts = facts_of_keywords(keywords)
        is_plain = image.scaling == (0.0, 1.0)
        raw = stored.dtype.kind in "iu" and is_plain
        offset, factor = image.scaling
        quality = _quality(image, stored)
        if raw and facts["instrument_names"]:
            quality |= np.where(zero_filled(stored), np.uint16(Quality.MISSING), np.uint16(0))
        return Reading(
            format="isis2" if image.is_qube else "pds3",
            image=stored if is_plain else offset + factor * stored.astype(np.float64),
            quality=quality,
            raw_dn=raw,
            label=plain_label(plain_values(keywords)),
            flags_from="the missing values that its label names",
            remarks=display_remarks(keywords),
            **facts,
        )


@dataclass(frozen=True)
class _Image:
    array: RawArray
    file: Path
    names: list[str]
    scaling: tuple[float, float]
    keywords: Mapping[str, Any]
    record_bytes: int
    is_qube: bool


def parsed_label(path: Path, label_file: Path) -> Mapping[str, Any]:
    """The label of image `path`, with its objects. Raises RefusedError when it is none, or larger than any."""
    with open_regular(label_file) as file:
        text = file.read(MAX_LABEL_BYTES).partition(b"\0")[0].decode("latin-1")
    end = END.search(text)
    if end is None:
        raise unreadable(path, f"the PDS3 label in {label_file.name} has no END")
    try:
        return load_pvl(text[: end.end()])
    except ValueError as error:
        raise unreadable(path, str(error)) from error


def keywords_of(label: Mapping[str, Any]) -> dict[str, Any]:
    """Keywords of the label, its image object, its groups of ISIS2."""
    inner = [value for _, value in label.items() if hasattr(value, "items")]
    qube_groups = [each for value in inner for _, each in value.items() if hasattr(each, "items")]
    wanted = [value for key, value in label.items() if key in ("IMAGE", *QUBES)]
    others = [value for value in inner if value not in wanted and "COLUMNS" not in value]
    return flat([label, *wanted, *qube_groups, *others])


def display_remarks(keywords: Mapping[str, Any]) -> tuple[str, ...]:
    """A sentence where a label says that the picture is shown otherwise than in the file's order."""
    said = [
        f"{key} = {keywords[key]}"
        for key, usual in (("LINE_DISPLAY_DIRECTION", "DOWN"), ("SAMPLE_DISPLAY_DIRECTION", "RIGHT"))
        if str(keywords.get(key) or usual).upper() != usual
    ]
    if not said:
        return ()
    return (f"the label says {' and '.join(said)}; lines and samples are taken in the file's order, see --flip",)


def lines_by_label(path: Path) -> int | None:
    """Lines that the PDS3 label beside an image gives it; None without a sound label."""
    beside = label_beside(path)
    if beside is None or beside.suffix.lower() != ".lbl":
        return None
    try:
        lines = parsed_label(path, beside).get("IMAGE", {}).get("LINES")
    except (RefusedError, AttributeError):
        return None
    return lines if isinstance(lines, int) else None


def _describes(label_file: Path, path: Path) -> bool:
    try:
        label = parsed_label(path, label_file)
        return _image(path, label, label_file).file == path
    except (RefusedError, OSError):
        return False


def _image(path: Path, label: Mapping[str, Any], label_file: Path) -> _Image:
    """The label's image: the first object IMAGE or QUBE that it points at, else an object whose name ends so."""
    names = [str(key) for key, value in label.items() if hasattr(value, "items") and f"^{key}" in label]
    wanted = [name for name in ("IMAGE", *QUBES) if name in names]
    wanted += [name for name in names if name.endswith("_IMAGE") and name not in wanted]
    if not wanted:
        raise unreadable(path, f"the label in {label_file.name} points at no image", "Give an image with its label.")
    keywords, pointer = label[wanted[0]], label[f"^{wanted[0]}"]
    record_bytes = max(1, int(number(label, "RECORD_BYTES") or 1))
    file, offset = _place(path, label_file, pointer, record_bytes)
    is_qube = wanted[0] in QUBES or "CORE_ITEMS" in keywords
    array = (_qube if is_qube else _plain_image)(path, keywords, offset)
    scaling = [
        next((value for value in (number(keywords, key) for key in keys) if value is not None), usual)
        for keys, usual in ((("OFFSET", "CORE_BASE"), 0.0), (("SCALING_FACTOR", "CORE_MULTIPLIER"), 1.0))
    ]
    return _Image(
        array, file, _names(label, keywords, array.bands), (scaling[0], scaling[1]), keywords, record_bytes, is_qube
    )


def _place(path: Path, label_file: Path, pointer: Any, record_bytes: int) -> tuple[Path, int]:
    """File and byte (from 0) of a pointer: a record or <BYTES>, both from 1, with or without a file's name."""
    parts = list(pointer) if isinstance(pointer, (list, tuple)) else [pointer]
    file = data_beside(label_file, parts.pop(0)) if parts and isinstance(parts[0], str) else label_file
    at = parts[0] if parts else 1
    in_bytes = str(getattr(at, "units", "")).upper().startswith("BYTE")
    value = getattr(at, "value", at)
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise unreadable(path, f"its label points at {pointer!r}")
    return file, value - 1 if in_bytes else (value - 1) * record_bytes


def _count(path: Path, keywords: Mapping[str, Any], key: str, usual: int | None = None) -> int:
    value = keywords.get(key, usual)
    value = getattr(value, "value", value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise unreadable(path, f"its label gives {key} = {value!r}, a whole number is needed")
    return value


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


def _plain_image(path: Path, keywords: Mapping[str, Any], offset: int) -> RawArray:
    coded = str(keywords.get("ENCODING_TYPE") or "N/A").upper()
    if coded not in ("N/A", "NONE", "NULL", "UNCOMPRESSED"):
        raise RefusedError("image-compressed", f"image {path}: its samples are coded ({coded}).", GIVE_PLAIN)
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


def _qube(path: Path, keywords: Mapping[str, Any], offset: int) -> RawArray:
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


def _names(label: Mapping[str, Any], keywords: Mapping[str, Any], bands: int) -> list[str]:
    for key in ("BAND_NAME", "FILTER_NAME"):
        for where in (keywords, label, keywords.get("BAND_BIN", {})):
            names = [str(name) for name in items(where.get(key))] if hasattr(where, "get") else []
            if bands > 1 and len(names) == bands:
                return names
    return [""] * min(bands, MAX_BANDS + 1)


def _quality(image: _Image, stored: NDArray[Any]) -> NDArray[np.uint16]:
    kind = stored.dtype.str[1:]
    if image.is_qube and kind in ("i2", "f4"):
        quality = special_pixels(stored, kind)
    else:
        quality = np.zeros(stored.shape, np.uint16)
    for keys, flag in ((MISSING_KEYS, Quality.MISSING), (SATURATED_KEYS, Quality.SATURATED)):
        for key in keys:
            value = special_value(image.keywords.get(key), stored.dtype)
            if value is not None:
                quality[stored == value] |= np.uint16(flag)
    return quality


def special_value(value: Any, dtype: np.dtype[Any]) -> Any:
    """A special value of a label as a number of the samples' type: a number, or bits such as 16#FF7FFFFB#; None where
    it says nothing."""
    value = getattr(value, "value", value)
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    if isinstance(value, str):
        match = re.fullmatch(r"\s*(?:16#|0x)([0-9A-Fa-f]{1,16})#?\s*", value)
        if match is None:
            stated = number({"value": value}, "value")
            return None if stated is None else special_value(stated, dtype)
        value = int(match.group(1), 16)
    if dtype.kind == "f" and isinstance(value, int) and value > 0x7F800000:  # the bits of a real number
        raw = value.to_bytes(8, "big")[-dtype.itemsize :]
        return np.frombuffer(raw, f">f{dtype.itemsize}")[0]
    if dtype.kind in "iu":
        limits = np.iinfo(dtype)
        return int(value) if value == int(value) and limits.min <= value <= limits.max else None
    return value
