"""The time of exposure in a FITS header, after the FITS standard 4.0, section 9 (Rots et al. 2015, A&A 574, A36).

DATE-AVG and MJD-AVG are the middle; DATE-BEG, DATE-END, MJD-BEG, MJD-END, TSTART and TSTOP the ends; DATE-OBS and
MJD-OBS the start (section 4.4.2.2) unless the keyword's comment says middle or end. TIMESYS is the scale of them all,
UTC by default. Beside the standard: DATE-MID and EXPMID, EXPSTART and EXPEND of Hubble's files, and the time of day in
TIME-OBS, UTC-OBS, UTSTART ... where DATE-OBS has only the day, as it had to before 2000 (also as dd/mm/yy), or the day
and T00:00:00.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from catalog.readers.exposure_time import ExposureTime, Place, TimeClaim, checked, claim, exposure_time
from catalog.readers.label_values import number, text
from catalog.times import et_from_mjd, et_from_time

SCALES = {
    "UTC": "utc", "UT": "utc", "GMT": "utc", "UT1": "ut1", "TAI": "tai", "IAT": "tai", "TT": "tt", "TDT": "tt",
    "ET": "tt", "TDB": "tdb", "TCB": "tcb", "TCG": "tcg", "GPS": "gps",
}  # fmt: skip
ELSEWHERE = ("BARYCENT", "HELIOCEN", "EMBARYCE")  # TREFPOS: where light arrived minutes before or after the camera
CLOCKS = ("TIME-OBS", "TIME_OBS", "UTC-OBS", "UT-OBS", "UTSTART", "TIME-BEG", "UTSHUT", "UT", "UTC")
DATES: dict[str, tuple[Place, tuple[str, ...]]] = {  # keyword: what it is of, and where its time of day may be
    "DATE-AVG": ("middle", ("TIME-AVG",)),
    "SPCUTCAL": ("middle", ()),  # New Horizons
    "DATE-MID": ("middle", ("TIME-MID", "UTMIDDLE")),
    "DATE-BEG": ("start", ("TIME-BEG", "UTSTART")),
    "DATE-END": ("end", ("TIME-END", "UTEND", "UTSTOP")),
    "DATE-OBS": ("start", CLOCKS),
    "DATE_OBS": ("start", CLOCKS),
    "START_TIME": ("start", ()),  # as PDS labels have them
    "STOP_TIME": ("end", ()),
}
MJDS: dict[str, Place] = {
    "MJD-AVG": "middle", "EXPMID": "middle", "MJD-BEG": "start", "EXPSTART": "start", "MJD-END": "end", "EXPEND": "end",
    "MJD-OBS": "start",
}  # fmt: skip
LONE_DAYS = {"MJD": 0.0, "JD": 2400000.5}
LENGTHS = ("XPOSURE", "EXPTIME", "TELAPSE")
UNITS_S = {"S": 1.0, "MIN": 60.0, "H": 3600.0, "D": 86400.0, "MS": 1e-3}
OLD_DAY = re.compile(r"(\d{2})/(\d{2})/(\d{2})")
MIDNIGHT = re.compile(r"(\d{4}-\d{2}-\d{2})[T ]00:00(?::00(?:\.0*)?)?")
CLOCK = re.compile(r"(\d{1,2}:\d{2}(?::\d{2}(?:\.\d*)?)?) *(?:Z|UTC?)?")
IS_MIDDLE = re.compile(r"\b(mid|middle|midpoint|cent(er|re)|average|avg)\b", re.IGNORECASE)
IS_END = re.compile(r"\b(end|stop|finish)\b", re.IGNORECASE)


def fits_exposure_time(header: Mapping[str, Any], comments: Mapping[str, str]) -> ExposureTime:
    """The middle of the exposure that the header's keywords agree on. comments: of the keywords."""
    claims = [*_dates(header, comments), *_mjds(header, comments), *_relative(header)]
    if all(each.et is None for each in claims):
        claims += _lone(header, comments)
    fault = _fault_of_scale(header)
    if fault:
        claims = [TimeClaim(c.keyword, c.value, c.place, fault=fault) for c in claims]
    return exposure_time(claims, {key: exposure_s(header, key) for key in LENGTHS}, gaps_count=True)


def exposure_s(header: Mapping[str, Any], *keywords: str) -> float | None:
    """The first exposure time that is known, seconds: XPOSURE and TELAPSE are in TIMEUNIT, EXPTIME in seconds."""
    for key in keywords or LENGTHS[:2]:
        value = number(header, key)
        if value is not None and value >= 0:
            return value if key == "EXPTIME" else value * _unit_s(header)
    return None


def _unit_s(header: Mapping[str, Any]) -> float:
    return UNITS_S.get((text(header, "TIMEUNIT") or "s").upper(), 1.0)


def _scale(header: Mapping[str, Any]) -> str | None:
    """astropy's name of TIMESYS, whose realisation in brackets (`TT(TAI)`) does not count; None for an unknown one."""
    return SCALES.get((text(header, "TIMESYS") or "UTC").upper().partition("(")[0].strip())


def _fault_of_scale(header: Mapping[str, Any]) -> str:
    if _scale(header) is None:
        return f"TIMESYS = {text(header, 'TIMESYS')} is no known time scale"
    place = (text(header, "TREFPOS") or "").upper()
    return f"TREFPOS = {place} is not where the camera is" if place.startswith(ELSEWHERE) else ""


def _place(keyword: str, comments: Mapping[str, str], usual: Place) -> Place:
    """What a keyword's time is of; DATE-OBS, MJD-OBS and those of no convention may be explained in their comment."""
    may_be = keyword.endswith(("-OBS", "_OBS")) or keyword in (*LONE_DAYS, "ET")
    comment = comments.get(keyword, "") if may_be else ""
    if IS_MIDDLE.search(comment):
        return "middle"
    return "end" if IS_END.search(comment) else usual


def _dates(header: Mapping[str, Any], comments: Mapping[str, str]) -> Iterator[TimeClaim]:
    scale = _scale(header) or "utc"
    for keyword, (usual, clocks) in DATES.items():
        value = text(header, keyword)
        if value is None:
            continue
        old = OLD_DAY.fullmatch(value)
        day, scale_of_day = (f"19{old[3]}-{old[2]}-{old[1]}", "utc") if old else (value, scale)
        midnight = MIDNIGHT.fullmatch(value)
        if midnight and any(CLOCK.fullmatch(text(header, clock) or "") for clock in clocks):
            day = midnight[1]  # the time of day is in the other keyword, the zeros only fill the format up
        place = _place(keyword, comments, usual)
        found = claim(keyword, day, place, scale_of_day)
        if found and (found[0].day_et is not None):
            found = _with_time_of_day(header, found[0], day, clocks, scale_of_day)
        yield from found


def _with_time_of_day(
    header: Mapping[str, Any], day: TimeClaim, iso_day: str, clocks: tuple[str, ...], scale: str
) -> list[TimeClaim]:
    """The day with the time of day of another keyword (UT... are UTC by their name), or the day as it is."""
    for keyword in clocks:
        value = text(header, keyword)
        if value is None:
            continue
        clock, named = CLOCK.fullmatch(value), f"{day.keyword} and {keyword}"
        if clock is None:
            fault = "there is no time of day such as 14:05:21"
            return [TimeClaim(named, f"{iso_day} {value}", day.place, fault=fault, day_et=day.day_et)]
        return claim(named, f"{iso_day}T{clock[1]}", day.place, "utc" if keyword.startswith("UT") else scale)
    return [day]


def _mjds(header: Mapping[str, Any], comments: Mapping[str, str]) -> Iterator[TimeClaim]:
    for keyword, usual in MJDS.items():
        yield from _days(header, comments, keyword, usual, 0.0)


def _lone(header: Mapping[str, Any], comments: Mapping[str, str]) -> Iterator[TimeClaim]:
    """Times of no convention, which count where nothing else tells: MJD and JD, and ET in seconds past J2000, TDB; of
    the start of the exposure unless their comment says otherwise."""
    for keyword, zero in LONE_DAYS.items():
        yield from _days(header, comments, keyword, "start", zero)
    et = number(header, "ET")
    if et is not None:
        yield checked(TimeClaim("ET", f"{et}", _place("ET", comments, "start"), et))


def _days(
    header: Mapping[str, Any], comments: Mapping[str, str], keyword: str, usual: Place, zero: float
) -> Iterator[TimeClaim]:
    """What a keyword of days says, counted from the modified Julian day's zero less `zero` days."""
    value = number(header, keyword)
    if value is None:
        return
    days, place = value - zero, _place(keyword, comments, usual)
    try:
        et = et_from_mjd(days, _scale(header) or "utc") if 0 <= days < 1e5 else None
    except ValueError:
        et = None
    if et is None:
        yield TimeClaim(keyword, f"{value}", place, fault="it is no time of an exposure")
    elif days == int(days):
        yield TimeClaim(keyword, f"{value:.10g}", place, fault="it is a day without a time of day", day_et=et)
    else:
        yield checked(TimeClaim(keyword, f"{value}", place, et))


def _relative(header: Mapping[str, Any]) -> Iterator[TimeClaim]:
    """TSTART and TSTOP, in TIMEUNIT after MJDREF, JDREF or DATEREF (section 9.4.2)."""
    places: dict[str, Place] = {"TSTART": "start", "TSTOP": "end"}
    for keyword, place in places.items():
        elapsed = number(header, keyword)
        if elapsed is None:
            continue
        try:
            et = _et_after_reference(header, (elapsed + (number(header, "TIMEOFFS") or 0.0)) * _unit_s(header))
        except ValueError:
            et = None
        if et is not None:
            yield checked(TimeClaim(keyword, f"{elapsed}", place, et))


def _et_after_reference(header: Mapping[str, Any], seconds: float) -> float | None:
    scale = _scale(header) or "utc"
    for whole, parts, zero in (
        ("MJDREF", ("MJDREFI", "MJDREFF"), 0.0),
        ("JDREF", ("JDREFI", "JDREFF"), 2400000.5),
    ):
        if number(header, parts[0]) is not None:
            days = (number(header, parts[0]) or 0.0) - zero + (number(header, parts[1]) or 0.0)
            return et_from_mjd(days, scale, seconds)
        if number(header, whole) is not None:
            return et_from_mjd((number(header, whole) or 0.0) - zero, scale, seconds)
    date = text(header, "DATEREF")
    if date is None:
        return None
    return et_from_time(date if "T" in date else f"{date}T00:00:00", scale) + seconds
