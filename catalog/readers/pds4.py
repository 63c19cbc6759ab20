"""PDS4 images: an XML label with arrays (PDS4 Information Model, class Array and its kinds) and the file beside it.

Read are Array_2D_Image and Array_3D_Image of whole numbers and reals, with their scaling and special constants. The
label's file is looked for in the label's folder only; labels with a document type or entities are refused.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from catalog.detached import MAX_LABEL_BYTES, PDS4_SUFFIXES, data_beside, label_beside
from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers.bands import chosen_plane
from catalog.readers.exposure_time import claim, exposure_time
from catalog.readers.label_values import number, plain_label
from catalog.readers.names import targets_of_label
from catalog.readers.pds3_array import special_value
from catalog.readers.raw_array import Order, RawArray, check_array, check_end, read_band
from catalog.readers.reading import Reading, unreadable
from catalog.readers.stated_mode import stated_mode
from catalog.regular_file import read_regular

START = re.compile(rb"\s*(?:\xef\xbb\xbf)?\s*<\?xml")
MAX_ELEMENTS = 20_000
MAX_DEPTH = 50
KIND = re.compile(r"(Unsigned|Signed)(?:Byte|(LSB|MSB)(2|4|8))|IEEE754(LSB|MSB)(Single|Double)")
ARRAYS = ("Array_2D_Image", "Array_3D_Image", "Array_2D", "Array_3D")
MISSING = ("missing_constant", "invalid_constant", "unknown_constant", "not_applicable_constant", "error_constant",
           "low_instrument_saturation", "low_representation_saturation")  # fmt: skip
SATURATED = ("saturated_constant", "high_instrument_saturation", "high_representation_saturation")
DURATION_UNITS_S = {"s": 1.0, "ms": 1e-3, "min": 60.0, "microseconds": 1e-6, "hr": 3600.0}
UPWARDS = "bottom to top"


class Pds4Reader:
    """PDS4 images, by the label or by the file with the pixels."""

    def recognises(self, head: bytes, path: Path) -> bool:
        """An XML file with a product of PDS4, or a file that such a label beside it names."""
        if START.match(head):
            return b"<Product_" in head or b"pds.nasa.gov/pds4" in head
        beside = label_beside(path)
        return beside is not None and beside.suffix.lower() in PDS4_SUFFIXES and _describes(beside, path)

    def read(self, path: Path, plane: str | None = None) -> Reading:
        """Pixels and metadata of one plane of the label's first array, or of this file's."""
        label_file = path if path.suffix.lower() in PDS4_SUFFIXES else label_beside(path) or path
        root = parsed_xml(path, label_file)
        arrays = arrays_of(path, root, label_file)
        planes = [(array, band) for array in arrays for band in range(array.raw.bands)]
        several = len(planes) > 1
        names = [
            array.name + (f":{band + 1}" if array.raw.bands > 1 else "") if several else "" for array, band in planes
        ]
        default = 0 if arrays[0].raw.bands == 1 else None
        if plane is None and default is None:
            names = names[: arrays[0].raw.bands]
        array, band = planes[chosen_plane(path, names, plane, default)]
        same_file = [each.raw for each in arrays if each.file == array.file]
        for raw in same_file:
            check_array(array.file, raw)
        check_end(array.file, max(raw.end for raw in same_file), 1, array.file_bytes)
        stored = read_band(array.file, array.raw, band)
        offset, factor = array.scaling
        is_plain = (offset, factor) == (0.0, 1.0)
        facts = facts_of_xml(root)
        return Reading(
            format="pds4",
            image=stored if is_plain else offset + factor * stored.astype(np.float64),
            quality=_quality(array, stored),
            raw_dn=stored.dtype.kind in "iu" and is_plain,
            flags_from="the special constants of its label",
            **facts,
        )


@dataclass(frozen=True)
class Pds4Array:
    """One array of a label. file_bytes: of its file, as the label gives it. scaling: offset and factor. missing,
    saturated: constants of such pixels."""

    file: Path
    file_bytes: int | None
    name: str
    raw: RawArray
    scaling: tuple[float, float]
    missing: tuple[str, ...]
    saturated: tuple[str, ...]


def parsed_xml(path: Path, label_file: Path) -> ElementTree.Element:
    """The label's root, names without namespaces. Raises RefusedError when it is no sound XML, or larger than any."""
    content = read_regular(label_file, MAX_LABEL_BYTES)
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise unreadable(path, f"the label {label_file.name} has a document type", "Give a plain PDS4 label.")
    depth = count = 0
    root: ElementTree.Element | None = None
    try:
        for event, element in ElementTree.iterparse(BytesIO(content), ("start", "end")):
            depth += 1 if event == "start" else -1
            count += event == "start"
            if depth > MAX_DEPTH or count > MAX_ELEMENTS:
                raise unreadable(path, f"the label {label_file.name} has too many elements")
            root = element if root is None else root
            element.tag = str(element.tag).rpartition("}")[2]
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise unreadable(path, f"the label {label_file.name} is no sound XML ({error})") from error
    if root is None or not root.tag.startswith("Product_"):
        raise unreadable(path, f"{label_file.name} is no label of a PDS4 product")
    return root


def arrays_of(path: Path, root: ElementTree.Element, label_file: Path) -> list[Pds4Array]:
    """The label's images, those of the file `path` first; of its other files those that are beside the label."""
    found: list[Pds4Array] = []
    others: set[str] = set()
    for area in (each for each in root.iter() if each.tag.startswith("File_Area")):
        elements = [element for name in ARRAYS for element in area if element.tag == name]
        others |= {each.tag for each in area if each.tag not in ("File", *ARRAYS)}
        name = _text(area, "File/file_name")
        if not name or not elements:
            continue
        try:
            file = data_beside(label_file, name)
        except RefusedError:
            if found:
                continue
            raise
        found += [_array(path, file, _file_bytes(area), element) for element in elements]
    if not found:
        listed = f" (only {', '.join(sorted(others))})" if others else ""
        fault = f"the label {label_file.name} describes no image{listed}"
        raise unreadable(path, fault, f"Give an image with its label: {' or '.join(ARRAYS)}.")
    return sorted(found, key=lambda array: array.file != path)


def facts_of_xml(root: ElementTree.Element) -> dict[str, Any]:
    """Arguments of `Reading` that a label gives: instrument, targets, time, exposure, filter, where each came from."""
    parts = [(_text(each, "type") or "", _text(each, "name") or "") for each in root.iter("Observing_System_Component")]
    hosts, instruments = (
        [name for kind, name in parts if kind.lower() in kinds]
        for kinds in (("spacecraft", "host", "rover", "lander"), ("instrument",))
    )
    names = tuple(f"{host.upper()}/{instrument.upper()}" for host in hosts for instrument in instruments)
    targets = targets_of_label([_text(each, "name") for each in root.iter("Target_Identification")])
    duration = next(_named(root, "exposure_duration"), None)
    exposure_s = None
    if duration is not None:
        amount = number({"value": duration.text}, "value")
        exposure_s = None if amount is None else amount * DURATION_UNITS_S.get(duration.get("unit", "s"), 1.0)
    claims = [
        *claim("start_date_time", _first_text(root, "start_date_time"), "start"),
        *claim("stop_date_time", _first_text(root, "stop_date_time"), "end"),
    ]
    time = exposure_time(claims, {"exposure_duration": exposure_s})
    filter_name = _first_text(root, "filter_name") or _first_text(root, "filter_id")
    label = {element.tag: element.text.strip() for element in root.iter() if element.text and element.text.strip()}
    mode = stated_mode({key.upper(): value for key, value in label.items()})
    sources = {
        "camera": "Observing_System_Component" if names else "",
        "target": "Target_Identification" if targets else "",
        "time": time.source,
        "exposure_s": "exposure_duration" if exposure_s is not None else "",
        "filter": "filter_name" if filter_name else "",
        "mode": mode.source,
    }
    vertical = (_first_text(root, "vertical_display_direction") or "").lower()
    remark = "the label shows the picture bottom to top; lines are taken in the file's order, see --flip"
    return {
        "instrument_names": names,
        "targets": targets,
        "time": time,
        "exposure_s": exposure_s,
        "filter": filter_name,
        "gain": _first_text(root, "gain_mode_id"),
        "stated": mode,
        "remarks": (remark,) if vertical == UPWARDS else (),
        "label": plain_label(label),
        "sources": {what: source for what, source in sources.items() if source},
    }


def _describes(label_file: Path, path: Path) -> bool:
    try:
        return arrays_of(path, parsed_xml(path, label_file), label_file)[0].file == path
    except (RefusedError, OSError):
        return False


def _named(root: ElementTree.Element, name: str) -> Iterator[ElementTree.Element]:
    return (element for element in root.iter(name) if element.text and element.text.strip())


def _first_text(root: ElementTree.Element, name: str) -> str | None:
    found = next(_named(root, name), None)
    return None if found is None or found.text is None else found.text.strip()


def _text(element: ElementTree.Element, place: str) -> str | None:
    found = element.findtext(place)
    return found.strip() if found and found.strip() else None


def _file_bytes(area: ElementTree.Element) -> int | None:
    size = next((number({"size": element.text}, "size") for element in _named(area, "file_size")), None)
    return None if size is None else int(size)


def _whole(path: Path, element: ElementTree.Element, place: str) -> int:
    value = _text(element, place)
    if value is None or not value.isdecimal() or len(value) > 18:
        raise unreadable(path, f"its PDS4 label gives {place} = {value!r}, a whole number is needed")
    return int(value)


def _array(path: Path, file: Path, file_bytes: int | None, element: ElementTree.Element) -> Pds4Array:
    axes = sorted(element.findall("Axis_Array"), key=lambda axis: _whole(path, axis, "sequence_number"))
    sizes = [_whole(path, axis, "elements") for axis in axes]
    labels = [(_text(axis, "axis_name") or "").lower() for axis in axes]
    if len(sizes) not in (2, 3) or (_text(element, "axis_index_order") or "").lower() == "first index fastest":
        raise unreadable(path, f"its PDS4 label gives an array of axes {labels}", "Give an image of two or three axes.")
    band = next((place for place, name in enumerate(labels) if name.startswith("band")), 0) if len(sizes) == 3 else None
    order: Order = "band" if band is None else ("band", "line", "sample")[band]
    shown = [name for place, name in enumerate(labels) if place != band]
    if shown[0].startswith("sample") and shown[1].startswith("line"):
        raise unreadable(path, f"its PDS4 label gives an array of axes {labels}", "Give lines before samples.")
    lines, samples = (size for place, size in enumerate(sizes) if place != band)
    offset, factor = (number({"value": element.findtext(f"Element_Array/{key}")}, "value") for key in
                      ("value_offset", "scaling_factor"))  # fmt: skip
    constants = element.find("Special_Constants")
    special = {each.tag: (each.text or "").strip() for each in constants} if constants is not None else {}
    return Pds4Array(
        file=file,
        file_bytes=file_bytes,
        name=_text(element, "local_identifier") or _text(element, "name") or "",
        raw=RawArray(
            offset=_whole(path, element, "offset"),
            lines=lines,
            samples=samples,
            kind=_kind(path, _text(element, "Element_Array/data_type") or ""),
            bands=1 if band is None else sizes[band],
            order=order,
        ),
        scaling=(0.0 if offset is None else offset, 1.0 if factor is None else factor),
        missing=tuple(special[name] for name in MISSING if name in special),
        saturated=tuple(special[name] for name in SATURATED if name in special),
    )


def _kind(path: Path, data_type: str) -> str:
    match = KIND.fullmatch(data_type)
    if match is None:
        raise unreadable(path, f"its PDS4 label gives samples of type {data_type!r}", "Give whole numbers or reals.")
    sign, integer_order, size, real_order, real = match.groups()
    order = "<" if (integer_order or real_order) == "LSB" else ">"
    if real:
        return f"{order}f{4 if real == 'Single' else 8}"
    return f"{order}{'u' if sign == 'Unsigned' else 'i'}{size or 1}"


def _quality(array: Pds4Array, stored: NDArray[Any]) -> NDArray[np.uint16]:
    quality = np.zeros(stored.shape, np.uint16)
    for constants, flag in ((array.missing, Quality.MISSING), (array.saturated, Quality.SATURATED)):
        for constant in constants:
            value = special_value(constant, stored.dtype)
            if value is not None:
                quality[stored == value] |= np.uint16(flag)
    return quality
