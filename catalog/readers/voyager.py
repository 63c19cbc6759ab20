"""Voyager ISS in VICAR: the 1980s' files and the PDS Ring Node's RAW, CLEANED, CALIB and GEOMED products.

Both carry the flight label as 72-character lines LAB01 .. LABnn. Its SCET is the end of the exposure: f1636832 (SCET
19:23:00, 360 ms) was exposed around 19:22:59.820, and the Ring Node's STOP_TIME equals the same SCET. A detached PDS3
label beside the file supplies START_TIME and STOP_TIME, whose middle is then used unless the others contradict it.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from catalog.readers.exposure_time import ExposureTime, claim, exposure_time
from catalog.readers.gaps import border_zeros, zero_filled
from catalog.readers.label_values import number, plain_label, text
from catalog.readers.names import PLANET_LETTERS, instrument_names, targets_of_label
from catalog.readers.pds3_label import detached_label
from catalog.readers.reading import Reading

SPACECRAFT = re.compile(r"\bVGR-([12])\b")
CAMERA = re.compile(r"\b([NW]A) CAMERA\b")
EXPOSURE = re.compile(r"\bEXP +(\d+(?:\.\d*)?) *MSEC")
FILTER = re.compile(r"\bFILT +\d\(([^)]*)\)")
SCET = re.compile(r"\bSCET +(\d{2})\.(\d{3}) +(\d{2}):(\d{2}):(\d{2})")
PICNO = re.compile(r"\bPICNO +(\S+)")
PICNO_PLANET = re.compile(r"\bPICNO +\d{4}([JSUN])\d[+-]\d{3}")
GAIN = re.compile(r"\b(LO|HI) +GAIN\b")
FDS = re.compile(r"\bFDS +(\d+\.\d+)")
TARGET = re.compile(r"\bOUT/\S+ {1,5}([A-Z][A-Z_ ]{1,11}?) +DSS")
OBJECT_SPACE = (1000, 1000)


def flight_label(label: dict[str, Any]) -> str:
    """The lines LAB01 .. LABnn joined into one text."""
    keys = sorted(key for key in label if re.fullmatch(r"LAB\d\d", key))
    return "\n".join(str(label[key]) for key in keys)


def matches(label: dict[str, Any]) -> bool:
    """Whether a VICAR label holds a Voyager flight label."""
    return SPACECRAFT.search(flight_label(label)) is not None


def reading(path: Path, label: dict[str, Any], pixels: NDArray[Any]) -> Reading:
    """Pixels and metadata of a raw, cleaned, calibrated or geometrically corrected frame."""
    flight, pds = flight_label(label), detached_label(path)
    exposure_s = _exposure_s(flight)
    undistorted = pixels.shape == OBJECT_SPACE
    targets, target_source, remarks = _targets(flight, pds)
    sources = {"camera": "the flight label", "target": target_source, "exposure_s": "EXP", "filter": "FILT"}
    return Reading(
        format="voyager-vicar",
        image=pixels,
        quality=_quality(pixels, undistorted),
        instrument_names=(*_instrument_names(flight), *instrument_names(pds)),
        targets=targets,
        time=_time(flight, pds, exposure_s),
        exposure_s=exposure_s if exposure_s is not None else number(pds, "EXPOSURE_DURATION"),
        filter=_word(FILTER, flight) or text(pds, "FILTER_NAME"),
        raw_dn=pixels.dtype == np.uint8,
        undistorted=undistorted or None,
        gain=_word(GAIN, flight) or text(pds, "GAIN_MODE_ID"),
        remarks=remarks,
        sources={what: source for what, source in sources.items() if source},
        label=plain_label({**pds, **label, "PICNO": _word(PICNO, flight), "FDS": _word(FDS, flight)}),
    )


def _targets(flight: str, pds: dict[str, Any]) -> tuple[tuple[str, ...], str, tuple[str, ...]]:
    """Targets, where they came from, and what contradicts them.

    Where no label says anything of a target, it is the planet whose letter the picture number has; a label that says
    that it has none is taken at its word."""
    said, keyword = pds.get("TARGET_NAME"), "TARGET_NAME"
    if not targets_of_label(said) and _word(TARGET, flight):
        said, keyword = _word(TARGET, flight), "the flight label"
    stated, picture, letter = targets_of_label(said), _word(PICNO, flight), PICNO_PLANET.search(flight)
    if letter is None:
        return stated, keyword if stated else "", ()
    planet = PLANET_LETTERS[letter.group(1).lower()]
    if said is None and keyword not in pds:
        remark = f"no label names the target: taken for {planet}, the planet of picture number {picture}; a moon of its"
        return (planet,), f"the planet's letter in PICNO {picture}", (f"{remark} needs --target",)
    others = [name for name in stated if name in PLANET_LETTERS.values() and name != planet]
    remarks = [f"the label says target {name}, its picture number {picture} says {planet}" for name in others]
    return stated, keyword if stated else "", tuple(remarks)


def _word(pattern: re.Pattern[str], flight: str) -> str | None:
    match = pattern.search(flight)
    return match.group(1).strip() if match else None


def _instrument_names(flight: str) -> tuple[str, ...]:
    spacecraft, camera = SPACECRAFT.search(flight), CAMERA.search(flight)
    return (f"VGR-{spacecraft.group(1)}/{camera.group(1)} CAMERA",) if spacecraft and camera else ()


def _exposure_s(flight: str) -> float | None:
    milliseconds = _word(EXPOSURE, flight)
    return None if milliseconds is None else float(milliseconds) / 1000


def _time(flight: str, pds: dict[str, Any], exposure_s: float | None) -> ExposureTime:
    """What the label beside the file and the flight label agree on."""
    claims = [
        *claim("START_TIME", text(pds, "START_TIME"), "start"),
        *claim("STOP_TIME", text(pds, "STOP_TIME"), "end"),
        *claim("IMAGE_TIME", text(pds, "IMAGE_TIME"), "near"),
    ]
    match = SCET.search(flight)
    if match is not None:
        year, day, hour, minute, second = match.groups()
        claims += claim("SCET", f"19{year}-{day}T{hour}:{minute}:{second}", "end")
    return exposure_time(claims, {"EXP": exposure_s, "EXPOSURE_DURATION": number(pds, "EXPOSURE_DURATION")})


def _quality(pixels: NDArray[Any], undistorted: bool) -> NDArray[np.uint16]:
    """MISSING for zero fill of raw frames and for the edges that a geometric correction could not reach."""
    if undistorted:
        missing = border_zeros(pixels)
    else:
        missing = zero_filled(pixels) if pixels.dtype == np.uint8 else np.zeros(pixels.shape, bool)
    extreme = np.abs(pixels.astype(np.int64)) >= 32767 if pixels.dtype.kind == "i" else np.zeros(pixels.shape, bool)
    flags = np.where(missing, Quality.OUTSIDE_WINDOW if undistorted else Quality.MISSING, 0)
    return np.where(extreme, flags | Quality.SATURATED, flags).astype(np.uint16)
