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

from catalog.bounded_pvl import MAX_LABEL_BYTES, load_pvl
from catalog.detached import data_beside, label_beside
from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers.bands import chosen_plane
from catalog.readers.gaps import zero_filled
from catalog.readers.isis import special_pixels
from catalog.readers.keywords import facts_of_keywords, flat, plain_values
from catalog.readers.label_values import items, number, plain_label
from catalog.readers.pds3_array import cube_array, image_array, special_value
from catalog.readers.raw_array import MAX_BANDS, RawArray, check_array, check_end, read_band
from catalog.readers.reading import Reading, unreadable
from catalog.regular_file import open_regular

START = re.compile(rb"\s*(?:PDS_VERSION_ID|CCSD3ZF)")
END = re.compile(r"(?m)^[ \t]*END[ \t]*\r?$")
QUBES = ("QUBE", "SPECTRAL_QUBE", "ISIS2_QUBE")
IMAGE_POINTER = re.compile(r"\^(?:\w*_)?(?:IMAGE|QUBE)")
MISSING_KEYS = (
    "MISSING_CONSTANT", "MISSING", "INVALID_CONSTANT", "INVALID", "NULL", "CORE_NULL", "CORE_LOW_REPR_SATURATION",
    "CORE_LOW_INSTR_SATURATION",
)  # fmt: skip
SATURATED_KEYS = ("SATURATED_CONSTANT", "CORE_HIGH_REPR_SATURATION", "CORE_HIGH_INSTR_SATURATION")


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
        records = number(_with_pointer(label), "FILE_RECORDS")
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
    label = _with_pointer(label)
    names = [str(key) for key, value in label.items() if hasattr(value, "items") and f"^{key}" in label]
    wanted = [name for name in ("IMAGE", *QUBES) if name in names]
    wanted += [name for name in names if name.endswith("_IMAGE") and name not in wanted]
    if not wanted:
        raise unreadable(path, f"the label in {label_file.name} points at no image", "Give an image with its label.")
    keywords, pointer = label[wanted[0]], label[f"^{wanted[0]}"]
    record_bytes = max(1, int(number(label, "RECORD_BYTES") or 1))
    file, offset = _place(path, label_file, pointer, record_bytes)
    is_qube = wanted[0] in QUBES or "CORE_ITEMS" in keywords
    array = (cube_array if is_qube else image_array)(path, keywords, offset)
    scaling = [
        next((value for value in (number(keywords, key) for key in keys) if value is not None), usual)
        for keys, usual in ((("OFFSET", "CORE_BASE"), 0.0), (("SCALING_FACTOR", "CORE_MULTIPLIER"), 1.0))
    ]
    return _Image(
        array, file, _names(label, keywords, array.bands), (scaling[0], scaling[1]), keywords, record_bytes, is_qube
    )


def _with_pointer(label: Mapping[str, Any]) -> Mapping[str, Any]:
    """The label, or the first of its objects FILE (UNCOMPRESSED_FILE ...) that points at an image."""
    files = [value for key, value in label.items() if str(key).endswith("FILE") and hasattr(value, "items")]
    return next(
        (each for each in [label, *files] if any(IMAGE_POINTER.fullmatch(str(key)) for key in each.keys())),  # noqa: SIM118 - pvl iterates over pairs
        label,
    )


def _place(path: Path, label_file: Path, pointer: Any, record_bytes: int) -> tuple[Path, int]:
    """File and byte (from 0) of a pointer: a record or <BYTES>, both from 1, with or without a file's name."""
    is_list = isinstance(pointer, (list, tuple)) and not hasattr(pointer, "units")  # a number with a unit is a tuple
    parts = list(pointer) if is_list else [pointer]
    file = data_beside(label_file, parts.pop(0)) if parts and isinstance(parts[0], str) else label_file
    at = parts[0] if parts else 1
    in_bytes = str(getattr(at, "units", "")).upper().startswith("BYTE")
    value = getattr(at, "value", at)
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise unreadable(path, f"its label points at {pointer!r}")
    return file, value - 1 if in_bytes else (value - 1) * record_bytes


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
