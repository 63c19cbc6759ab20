"""ISIS3 cubes: band-sequential and tiled cores, attached or detached, with ISIS' special pixels (ISIS SpecialPixel.h).

NULL and the low saturations are MISSING, the high saturations SATURATED. The numbers are base + multiplier * stored.
The group AlphaCube, which ISIS' crop and reduce write, says which window of the detector a cube holds.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.detached import data_beside, label_beside, name_described
from catalog.errors import RefusedError
from catalog.isis_tables import begins_as_cube, is_isis_cube, parsed_cube_label
from catalog.observation import Quality
from catalog.readers.bands import chosen_plane
from catalog.readers.keywords import USUAL_START, Start, facts_of_keywords, flat, isis_keyword, mid_time, plain_values
from catalog.readers.label_values import items, number, plain_label
from catalog.readers.raw_array import RawArray, check_array, check_end, read_band
from catalog.readers.reading import Reading, unreadable
from catalog.readers.stated_mode import UNSTATED, mode_of_alpha_cube, scaled
from catalog.reasons import Reason

KINDS = {
    "UNSIGNEDBYTE": "u1", "SIGNEDWORD": "i2", "UNSIGNEDWORD": "u2", "SIGNEDINTEGER": "i4", "UNSIGNEDINTEGER": "u4",
    "REAL": "f4", "DOUBLE": "f8",
}  # fmt: skip
# Of whole numbers: what is missing, and from where on what is saturated.
MISSING_VALUES = {"u1": (0,), "i2": (-32768, -32767, -32766), "u2": (0, 1, 2), "u4": (0, 1, 2)}
SATURATED_VALUES = {"u1": (255,), "i2": (-32765, -32764), "u2": (65534, 65535), "u4": (4294967294, 4294967295)}
# Of reals: bit patterns of NULL, low representation and low instrument saturation; of the high ones.
MISSING_BITS = {
    "f4": (0xFF7FFFFB, 0xFF7FFFFC, 0xFF7FFFFD),
    "f8": (0xFFEFFFFFFFFFFFFB, 0xFFEFFFFFFFFFFFFC, 0xFFEFFFFFFFFFFFFD),
}
SATURATED_BITS = {"f4": (0xFF7FFFFE, 0xFF7FFFFF), "f8": (0xFFEFFFFFFFFFFFFE, 0xFFEFFFFFFFFFFFFF)}
# What StartTime is of where it is not the start, and seconds to add: Galileo's is the middle, Voyager's the read-out,
# 2 s after the end (gllssi2isis, ALE's Voyager driver).
STARTS: dict[str, Start] = {"GALILEO": ("middle", 0.0), "VOYAGER": ("end", -2.0)}
# JunoCam's framelets: StartTime is that of the first one of the strip; the delays are longer than said (IK, v03).
FRAMELET_BIAS_S, FRAMELET_DELAY_BIAS_S = 0.06188, 0.001
GROUPS = ("Instrument", "Archive", "BandBin")
FOR_PROJECTED = "Give the cube in the camera's own geometry (level 1), not a map made of it."


class IsisReader:
    """Cubes of ISIS3, by the cube, its detached label, or the file with the pixels that one describes."""

    def recognises(self, head: bytes, path: Path) -> bool:
        """A label whose first object is IsisCube begins the file, or lies beside it and names it as its core."""
        return begins_as_cube(head) or _label_of_core(path) is not None

    def read(self, path: Path, plane: str | None = None) -> Reading:
        """Pixels and metadata of one band."""
        path = _label_of_core(path) or path
        label = _label(path)
        cube = _object(path, label, "IsisCube")
        core = _object(path, cube, "Core")
        if "Mapping" in cube:
            raise RefusedError(Reason.IMAGE_PROJECTED, f"image {path}: it is a map projection.", FOR_PROJECTED)
        array, kind, file = _array(path, core)
        check_array(file, array)
        pixels_group = _object(path, core, "Pixels")
        base, multiplier = (
            _number(path, pixels_group, key, usual) for key, usual in (("Base", 0.0), ("Multiplier", 1.0))
        )
        band = chosen_plane(path, _band_names(cube, array.bands), plane)
        if file == path:
            check_end(path, max(array.end, _end_of_objects(label)))
        stored = read_band(file, array, band)
        quality = special_pixels(stored, kind)
        is_plain = (base, multiplier) == (0.0, 1.0)
        pixels = stored if is_plain else _scaled(stored, base, multiplier, quality)
        return Reading(
            format="isis3",
            image=pixels,
            quality=quality,
            raw_dn=stored.dtype.kind in "iu" and multiplier == 1.0,
            flags_from="ISIS' special pixels",
            **facts_of_cube(cube, (array.lines, array.samples)),
        )


def facts_of_cube(cube: Mapping[str, Any], shape: tuple[int, int]) -> dict[str, Any]:
    """Arguments of `Reading` that the object IsisCube of a cube of `shape` (lines, samples) gives."""
    groups = [cube[group] for group in GROUPS if hasattr(cube.get(group), "items")]
    known = {isis_keyword(key): value for key, value in flat(groups).items()}
    host = str(known.get("SPACECRAFT_NAME", "")).upper()
    start = next((meaning for name, meaning in STARTS.items() if host.startswith(name)), USUAL_START)
    start = _start_of_framelet(known) or start
    facts = {**facts_of_keywords(known, start), "label": plain_label(plain_values(known))}
    facts |= _mid_exposure(known, facts)
    alpha = cube.get("AlphaCube")
    stated = UNSTATED if alpha is None or not hasattr(alpha, "items") else mode_of_alpha_cube(alpha, shape)
    if stated.summing is None:
        return facts
    inner = facts["stated"].summing or 1  # of the frame that the cube was cut from, which AlphaCube counts in
    stated = scaled(stated, inner)
    return {**facts, "stated": stated, "sources": {**facts["sources"], "mode": stated.source}}


def _start_of_framelet(known: Mapping[str, Any]) -> Start | None:
    """What StartTime is of in a cube with one framelet of JunoCam, and seconds to add; None for any other cube."""
    is_junocam = str(known.get("INSTRUMENT_ID")).upper() == "JNC"
    place, delay_s = (number({"value": getattr(known.get(key), "value", known.get(key))}, "value") for key in
                      ("FRAME_NUMBER", "INTER_FRAME_DELAY"))  # fmt: skip
    if not is_junocam or place is None or delay_s is None or place < 1:
        return None
    return "start", FRAMELET_BIAS_S + (place - 1) * (delay_s + FRAMELET_DELAY_BIAS_S)


def special_pixels(stored: NDArray[Any], kind: str) -> NDArray[np.uint16]:
    """Quality (ny, nx) of ISIS' special values in stored numbers of `kind` (`i2`, `f4` ...)."""
    quality = np.zeros(stored.shape, np.uint16)
    if kind in MISSING_BITS:
        native = stored.astype(stored.dtype.newbyteorder("="))
        bits = native.view(np.uint32 if kind == "f4" else np.uint64)
        missing = np.isin(bits, np.array(MISSING_BITS[kind], bits.dtype)) | ~np.isfinite(native)
        saturated = np.isin(bits, np.array(SATURATED_BITS[kind], bits.dtype))
    else:
        missing, saturated = (np.isin(stored, values.get(kind, ())) for values in (MISSING_VALUES, SATURATED_VALUES))
    quality[missing] |= np.uint16(Quality.MISSING)
    quality[saturated] |= np.uint16(Quality.SATURATED)
    return quality


def _scaled(stored: NDArray[Any], base: float, multiplier: float, quality: NDArray[np.uint16]) -> NDArray[np.float64]:
    with np.errstate(all="ignore"):
        return np.where(quality == 0, base + multiplier * stored.astype(np.float64), 0.0)


def _label(path: Path) -> Mapping[str, Any]:
    try:
        return parsed_cube_label(path)
    except ValueError as error:
        raise unreadable(path, str(error)) from error


def _label_of_core(path: Path) -> Path | None:
    """The detached label beside a file that says that the file is its core; None where there is none."""
    beside = label_beside(path)
    if beside is None or not is_isis_cube(beside) or name_described(beside) is None:
        return None
    try:
        return beside if data_beside(beside, str(name_described(beside))) == path else None
    except RefusedError:
        return None


def _object(path: Path, label: Mapping[str, Any], name: str) -> Any:
    found = label.get(name)
    if not hasattr(found, "items"):
        raise unreadable(path, f"its ISIS label has no {name}")
    return found


def _whole(path: Path, label: Mapping[str, Any], key: str, usual: int | None = None) -> int:
    value = label.get(key, usual)
    if isinstance(value, bool) or not isinstance(value, int):
        raise unreadable(path, f"its label gives {key} = {value!r}, a whole number is needed")
    return value


def _number(path: Path, label: Mapping[str, Any], key: str, usual: float) -> float:
    value = number({key: label.get(key, usual)}, key)
    if value is None:
        raise unreadable(path, f"its label gives {key} = {label.get(key)!r}, a number is needed")
    return value


def _array(path: Path, core: Mapping[str, Any]) -> tuple[RawArray, str, Path]:
    """Where the samples are, their kind without byte order, and the file that holds them."""
    size, pixels = _object(path, core, "Dimensions"), _object(path, core, "Pixels")
    kind = KINDS.get(str(pixels.get("Type")).upper())
    if kind is None:
        raise unreadable(path, f"its label gives pixels of type {pixels.get('Type')!r}", "Give whole or real numbers.")
    order = ">" if str(pixels.get("ByteOrder", "Lsb")).upper() == "MSB" else "<"
    tile = None
    if str(core.get("Format", "BandSequential")).upper() == "TILE":
        tile = (_whole(path, core, "TileLines"), _whole(path, core, "TileSamples"))
    file = data_beside(path, str(core["^Core"])) if core.get("^Core") else path
    array = RawArray(
        offset=_whole(path, core, "StartByte", 1) - 1,
        lines=_whole(path, size, "Lines"),
        samples=_whole(path, size, "Samples"),
        bands=_whole(path, size, "Bands", 1),
        kind=order + kind,
        tile=tile,
    )
    return array, kind, file


def _end_of_objects(label: Mapping[str, Any]) -> int:
    """The byte after the last table, history or other object that the label places in this file."""
    ends = [0]
    for _, each in label.items():
        if hasattr(each, "items") and "^" not in "".join(map(str, each)):
            start, length = each.get("StartByte"), each.get("Bytes")
            if isinstance(start, int) and isinstance(length, int):
                ends.append(start - 1 + length)
    return max(ends)


def _band_names(cube: Mapping[str, Any], bands: int) -> list[str]:
    group = cube.get("BandBin")
    for key in ("FilterName", "Name", "Filter"):
        has_group = group is not None and hasattr(group, "items")
        names = [str(name) for name in items(group.get(key))] if group is not None and has_group else []
        if len(names) == bands:
            return names
    return [""] * bands


def _mid_exposure(known: Mapping[str, Any], facts: Mapping[str, Any]) -> dict[str, Any]:
    """The time by EPHEMERIS_TIME (TDB, at mid-exposure) where the label gives it and no other time."""
    value = known.get("EPHEMERIS_TIME")
    et = number({"et": getattr(value, "value", value)}, "et")
    if et is None or facts["time"].et is not None:
        return {}
    time = mid_time(et, "EPHEMERIS_TIME")
    return {"time": time, "sources": {**facts["sources"], "time": time.source}}
