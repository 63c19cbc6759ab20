"""What keywords say of an image, whichever label carries them: VICAR, PDS3, ISIS (its names in PDS's spelling).

One road for all: time from IMAGE_MID_TIME, START_TIME, STOP_TIME and IMAGE_TIME, which have to agree with each other
and with the exposure; the target; filter, gain, summing, window. Each value is noted with the keyword it came from.
"""

import re
from collections.abc import Iterable, Mapping
from datetime import UTC, date, datetime
from typing import Any

from catalog.readers.exposure_time import ExposureTime, Place, TimeClaim, checked, claim, exposure_time
from catalog.readers.label_values import items, number, text
from catalog.readers.names import instrument_names, targets_of_label
from catalog.readers.stated_mode import stated_mode

PLACES: dict[str, Place] = {
    "IMAGE_MID_TIME": "middle",
    "MID_OBSERVATION_TIME": "middle",
    "CENTER_TIME": "middle",
    "START_TIME": "start",
    "STOP_TIME": "end",
    "IMAGE_TIME": "near",
}
Start = tuple[Place, float]
USUAL_START: Start = ("start", 0.0)
DURATIONS = ("EXPOSURE_DURATION", "EXPOSURE_TIME")
UNITS_S = {
    "S": 1.0, "SEC": 1.0, "SECOND": 1.0, "SECONDS": 1.0, "MS": 1e-3, "MSEC": 1e-3, "MILLISEC": 1e-3,
    "MILLISECOND": 1e-3, "MILLISECONDS": 1e-3, "US": 1e-6, "MICROSECONDS": 1e-6, "MICROSECOND": 1e-6,
}  # fmt: skip
LONGEST_S = 7200.0
FILTERS = ("FILTER_NAME", "FILTER", "FILTER_NUMBER")
GAINS = ("GAIN_MODE_ID", "GAIN_MODE", "GAIN_STATE", "SENSOR_ANALOG_GAIN", "GAIN_NUMBER")
TARGETS = ("TARGET_NAME", "TARGET", "TARGET_LIST")


def facts_of_keywords(label: Mapping[str, Any], start: Start = USUAL_START) -> dict[str, Any]:
    """Arguments of `Reading` that a flat label gives: names of the instrument, targets, time, exposure, filter, gain,
    mode, and where each came from. Quantities of pvl are understood with their units. start: what START_TIME is of, and
    seconds to add to it."""
    names = instrument_names(label)
    times = [
        stated
        for key, place in PLACES.items()
        for stated in _claims(label, key, start if key == "START_TIME" else (place, 0.0))
    ]
    duration_key = next((key for key in DURATIONS if _plain_number(label.get(key)) is not None), None)
    exposure_s = None if duration_key is None else _seconds(label[duration_key], times)
    time = exposure_time(times, {duration_key: exposure_s} if duration_key else {})
    target_key = next((key for key in TARGETS if targets_of_label(label.get(key))), None)
    filter_key, gain_key = (next((k for k in keys if text(label, k)), None) for keys in (FILTERS, GAINS))
    mode = stated_mode(label)
    found: dict[str, Any] = {
        "instrument_names": names,
        "targets": targets_of_label(label.get(target_key)) if target_key else (),
        "time": time,
        "exposure_s": exposure_s,
        "filter": text(label, filter_key) if filter_key else None,
        "gain": _gain(label, gain_key) if gain_key else None,
        "stated": mode,
    }
    sources = {
        "camera": _instrument_source(label) if names else None,
        "target": target_key,
        "time": time.source or None,
        "exposure_s": duration_key,
        "filter": filter_key,
        "gain": gain_key,
        "mode": mode.source or None,
    }
    return {**found, "sources": {what: source for what, source in sources.items() if source}}


def isis_keyword(name: str) -> str:
    """ISIS' keyword in PDS' spelling: StartTime is START_TIME."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).upper()


def time_text(value: Any) -> str | None:
    """A label's time as ISO text, whatever pvl has made of it; text after it in brackets does not count."""
    value = _bare(value)
    if isinstance(value, datetime):
        return (value.astimezone(UTC) if value.tzinfo else value).replace(tzinfo=None).isoformat()
    if isinstance(value, date):
        return value.isoformat()
    return text({"time": value}, "time")


def flat(objects: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """The keywords of several label objects, the first occurrence of each; nested objects are left out."""
    found: dict[str, Any] = {}
    for each in objects:
        for key, value in each.items():
            if not hasattr(value, "items"):
                found.setdefault(str(key), value)
    return found


def plain_values(label: Mapping[str, Any]) -> dict[str, Any]:
    """A flat label for provenance: times as ISO text, quantities with their unit in the keyword's value."""
    return {key: _shown(value) for key, value in label.items()}


def _shown(value: Any) -> Any:
    if isinstance(value, (datetime, date)):
        return time_text(value)
    if getattr(value, "units", None) is not None:
        return f"{value.value} <{value.units}>"
    if isinstance(value, (list, tuple, set, frozenset)):
        return [_shown(item) for item in items(value)]
    return value


def _claims(label: Mapping[str, Any], key: str, meaning: Start) -> list[TimeClaim]:
    place, later_s = meaning
    return claim(key, time_text(label.get(key)), place, later_s=later_s)


def _seconds(value: Any, times: list[TimeClaim]) -> float | None:
    """An exposure time: by its unit; without one, milliseconds as PDS counts them, unless START_TIME and STOP_TIME are
    so far apart that it must be seconds."""
    amount = _plain_number(value)
    if amount is None or amount < 0:
        return None
    unit = str(getattr(value, "units", "") or "").strip().upper()
    if unit:
        return amount * UNITS_S[unit] if unit in UNITS_S else None
    ends = {stated.place: stated.et for stated in times if stated.et is not None}
    if "start" in ends and "end" in ends:
        span = float(ends["end"] or 0.0) - float(ends["start"] or 0.0)
        if abs(span - amount) < abs(span - amount / 1000) and 0 <= span <= LONGEST_S:
            return amount
    return amount / 1000


def _plain_number(value: Any) -> float | None:
    first = items(_bare(value))[0] if items(_bare(value)) else None
    return number({"value": _bare(first)}, "value")


def _bare(value: Any) -> Any:
    return value.value if getattr(value, "units", None) is not None else value


def _gain(label: Mapping[str, Any], key: str) -> str | None:
    return text({key: _bare(label[key])}, key)


def _instrument_source(label: Mapping[str, Any]) -> str:
    from catalog.readers.names import HOST_KEYS, INSTRUMENT_KEYS

    used = [next((key for key in keys if label.get(key)), "") for keys in (HOST_KEYS, INSTRUMENT_KEYS)]
    return " and ".join(key for key in used if key)


def mid_time(et: float, keyword: str) -> ExposureTime:
    """The middle of an exposure that a label gives as TDB seconds past J2000."""
    return exposure_time([checked(TimeClaim(keyword, f"{et}", "middle", et))], {})
