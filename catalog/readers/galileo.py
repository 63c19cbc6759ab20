"""Galileo SSI REDR: an 800x800 frame with 200 bytes before every line, a valid window, and geometry in its label.

The keywords are those of the VICAR label, so that no detached .LBL is needed. ISIS takes the label's time as the
middle of the exposure (gllssi2isis), and so do we.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from catalog.readers.exposure_time import claim, exposure_time
from catalog.readers.gaps import zero_filled
from catalog.readers.label_values import number, plain_label, text
from catalog.readers.names import instrument_names, targets_of_label
from catalog.readers.reading import Reading
from catalog.readers.stated_mode import stated_mode

FRAME, SUMMED = (800, 800), (400, 400)
SOURCES = {"camera": "MISSION and SENSOR", "target": "TARGET", "exposure_s": "EXP", "filter": "FILTER", "gain": "GAIN"}
FILTERS = ("CLEAR", "GREEN", "RED", "VIOLET", "IR-7560", "IR-9680", "IR-7270", "IR-8890")
SCALARS = {  # ours: (keyword of the label, factor, constant)
    "distance_km": ("TARGET_CENTER_DISTANCE", 1.0, 0.0),
    "sub_spacecraft_lat_deg": ("SUB_SPACECRAFT_LATITUDE", 1.0, 0.0),
    "sub_spacecraft_lon_deg": ("SUB_SPACECRAFT_LONGITUDE", -1.0, 360.0),  # the label counts west
    "sub_solar_lat_deg": ("SUB_SOLAR_LATITUDE", 1.0, 0.0),
    "sub_solar_lon_deg": ("SUB_SOLAR_LONGITUDE", -1.0, 360.0),
    "north_azimuth_deg": ("NORAZ", 1.0, 0.0),
    "sub_solar_azimuth_deg": ("SUNAZ", 1.0, 0.0),
    "centre_x_px": ("SUB_SPACECRAFT_SAMPLE", 1.0, -1.0),  # the label counts pixels from 1
    "centre_y_px": ("SUB_SPACECRAFT_LINE", 1.0, -1.0),
    "solar_distance_km": ("SOLRANGE", 1.0, 0.0),
    "phase_deg": ("PHA", 1.0, 0.0),
}


def matches(label: dict[str, Any]) -> bool:
    """Whether a VICAR label is Galileo SSI's."""
    return label.get("MISSION") == "GALILEO" and label.get("SENSOR") == "SSI"


def reading(path: Path, label: dict[str, Any], pixels: NDArray[Any]) -> Reading:  # noqa: ARG001
    """Pixels and metadata; of a 2x2-summed frame, which some files hold in a corner of 800x800, that corner."""
    stated = stated_mode(label)
    if stated.summing == 2 and pixels.shape == FRAME and not _beyond(pixels, SUMMED).any():
        pixels = pixels[: SUMMED[0], : SUMMED[1]]
    exposure_ms = number(label, "EXP")
    filter_number = number(label, "FILTER")
    return Reading(
        format="galileo-redr",
        image=pixels,
        quality=_quality(label, pixels),
        instrument_names=instrument_names(label),
        targets=targets_of_label(label.get("TARGET")),
        time=exposure_time(claim("SCETYEAR .. SCETMSEC", _time(label), "middle"), {}),
        exposure_s=None if exposure_ms is None else exposure_ms / 1000,
        filter=FILTERS[int(filter_number)] if filter_number is not None and 0 <= filter_number < 8 else None,
        raw_dn=pixels.dtype == np.uint8,
        label_geometry=_geometry(label),
        stated=stated,
        gain=text(label, "GAIN"),
        sources=SOURCES | ({"mode": stated.source} if stated.source else {}),
        label=plain_label(label),
    )


def _beyond(pixels: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """All pixels below or to the right of a corner of `size` (lines, samples)."""
    return np.concatenate([pixels[size[0] :].ravel(), pixels[: size[0], size[1] :].ravel()])


def _time(label: dict[str, Any]) -> str | None:
    parts = [label.get(f"SCET{unit}") for unit in ("YEAR", "DAY", "HOUR", "MIN", "SEC", "MSEC")]
    if not all(isinstance(part, int) and part >= 0 for part in parts):
        return None
    year, day, hour, minute, second, millisecond = parts
    return f"{year:04d}-{day:03d}T{hour:02d}:{minute:02d}:{second:02d}.{millisecond:03d}"


def _geometry(label: dict[str, Any]) -> dict[str, float] | None:
    """The scalars of `catalog.label_geometry`; None when one that a pose needs is unknown."""
    values = {ours: (number(label, key), factor, constant) for ours, (key, factor, constant) in SCALARS.items()}
    known = {ours: factor * value + constant for ours, (value, factor, constant) in values.items() if value is not None}
    return known if len(known) == len(SCALARS) else None


def _quality(label: dict[str, Any], pixels: NDArray[Any]) -> NDArray[np.uint16]:
    """OUTSIDE_WINDOW beyond CUT_OUT_WINDOW = (line, sample, lines, samples), 1-based; MISSING for zero fill inside."""
    outside = np.zeros(pixels.shape, bool)
    window = label.get("CUT_OUT_WINDOW")
    if isinstance(window, list) and len(window) == 4 and all(isinstance(value, int) for value in window):
        line, sample, lines, samples = window
        if line >= 1 and sample >= 1 and lines >= 1 and samples >= 1:
            outside[:] = True
            outside[line - 1 : line - 1 + lines, sample - 1 : sample - 1 + samples] = False
    missing = zero_filled(pixels) & ~outside
    return np.where(outside, Quality.OUTSIDE_WINDOW, np.where(missing, Quality.MISSING, 0)).astype(np.uint16)
