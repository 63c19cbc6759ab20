"""Times of several scales as TDB and back, without a leap-second kernel: by ERFA, which carries the leap seconds; what
is out of the ordinary by astropy, whose import takes longer than all else here."""

import re
from contextlib import nullcontext
from datetime import UTC, date, datetime, timedelta

J2000_TT_JD = 2451545.0
GPS_BEHIND_TAI_S = 19.0
DAY_S = 86400.0
# Years whose leap seconds are known to any ERFA that we run with, and scales that it turns into TDB by itself.
KNOWN_YEARS, KNOWN_SCALES = range(1972, 2027), {"utc": "UTC", "tai": "TAI", "gps": "TAI", "tt": "TT", "tdb": "TDB"}
TIME = re.compile(
    r"(\d{4})-(?:(\d{2})-(\d{2})|(\d{3}))"  # calendar day, or day of the year
    r"(?:[T ](\d{1,2}):(\d{2})(?::(\d{2}(?:\.\d*)?))?)?"
    r" ?(?:Z|UTC?|([+-](?:0\d|1[0-4])):?([0-5]\d))?",  # clocks differ by 14 hours at most
)
EXAMPLE = "2000-05-22T23:52:05.277Z"
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
OTHER_DAYS = (  # written with slashes, or with the month's name
    re.compile(r"(?P<year>\d{4})/(?P<month>\d{2})/(?P<day>\d{2})"),
    re.compile(r"(?P<year>\d{4})[- ](?P<month>[a-z]{3})[a-z]*\.?[- ](?P<day>\d{1,2})", re.IGNORECASE),
    re.compile(r"(?P<day>\d{1,2})[- ](?P<month>[a-z]{3})[a-z]*\.?[- ](?P<year>\d{4})", re.IGNORECASE),
)


class DayOnlyError(ValueError):
    """A day without a time of day."""


def et_from_utc(utc: str) -> float:
    """TDB seconds past J2000 of an ISO UTC time (`2000-05-22T23:52:05.277Z` or `2015-195T00:35:54.780`; an offset such
    as +02:00 is obeyed).

    Raises ValueError for a text that is no time, and for a day without a time of day.
    """
    return et_from_time(utc, "utc")


def et_from_time(text: str, scale: str) -> float:
    """TDB seconds past J2000 of an ISO time (its day also as 2000/05/22, 2000 May 22 or 22-MAY-2000) in one of
    astropy's scales (utc, tdb, tt, tai, ut1, tcb, tcg) or in gps.

    Raises ValueError for what is no time of that scale: a second 60 must be a leap second; UT1 is known while IERS has
    published it; and DayOnlyError for a day without a time of day.
    """
    match = TIME.fullmatch(_iso(text.strip()))
    if match is None:
        raise ValueError(f"{text!r} is no {scale.upper()} such as {EXAMPLE}")
    year, month, day, day_of_year, hour, minute, second, offset_h, offset_min = match.groups()
    if hour is None:
        raise DayOnlyError(f"{text!r} is a day without a time of day")
    try:
        first = date(int(year), 1, 1)
        day_meant = first + timedelta(int(day_of_year) - 1) if day_of_year else date(int(year), int(month), int(day))
    except (ValueError, OverflowError) as error:
        raise ValueError(f"{text!r} is no day of the calendar") from error
    if day_meant.year != int(year) or (
        float(second or 0) >= 60 and not _is_leap_second(day_meant, hour, minute, scale)
    ):
        raise ValueError(f"{text!r} is no time: there is no such day, or no such second")
    clock = (int(hour), int(minute), float(second or 0))
    is_ordinary = clock[0] < 24 and clock[1] < 60 and clock[2] < 60 and day_meant.year in KNOWN_YEARS
    et = (
        _et_by_erfa(day_meant, clock, scale)
        if is_ordinary and scale in KNOWN_SCALES
        else _et_by_astropy(f"{day_meant.isoformat()}T{int(hour):02d}:{minute}:{second or '00'}", "isot", scale, text)
    )
    if offset_h is None:
        return et
    return et - 60.0 * (60 * int(offset_h) + (-1 if offset_h.startswith("-") else 1) * int(offset_min))


def _iso(text: str) -> str:
    """The text with its day as ISO 8601 has it; as it is where it has none of OTHER_DAYS."""
    match = next((found for pattern in OTHER_DAYS if (found := pattern.match(text))), None)
    month = match["month"].lower() if match else ""
    if match is None or not (month.isdecimal() or month in MONTHS):
        return text
    number = int(month) if month.isdecimal() else MONTHS.index(month) + 1
    return f"{match['year']}-{number:02d}-{int(match['day']):02d}{text[match.end() :]}"


def et_from_mjd(days: float, scale: str, seconds: float = 0.0) -> float:
    """TDB seconds past J2000 of a Modified Julian Date of `scale` (see `et_from_time`) and seconds after it. Raises
    ValueError as `et_from_time` does."""
    return _et_by_astropy(days, "mjd", scale, f"MJD {days}", seconds)


def _et_by_erfa(day: date, clock: tuple[int, int, float], scale: str) -> float:
    """TDB seconds past J2000 of a time of one of KNOWN_SCALES, by the steps that astropy takes; TDB is by its series at
    the centre of the Earth."""
    import erfa

    name = KNOWN_SCALES[scale]
    hour, minute, second = clock
    jd = erfa.dtf2d(name, day.year, day.month, day.day, hour, minute, second)
    if name == "UTC":
        jd = erfa.utctai(*jd)
    if name in ("UTC", "TAI"):
        jd = erfa.taitt(*jd)
    if name != "TDB":
        jd = erfa.tttdb(*jd, _tdb_less_tt_s(*jd))
    et = (jd[0] - J2000_TT_JD) * DAY_S + jd[1] * DAY_S
    return float(et + (GPS_BEHIND_TAI_S if scale == "gps" else 0.0))


def _tdb_less_tt_s(jd: float, more: float) -> float:
    """At a Julian date, in two parts, of either; universal time, which it hardly depends on, taken for UTC."""
    import erfa

    utc = erfa.taiutc(*erfa.tttai(jd, more))
    return float(erfa.dtdb(jd, more, (utc[0] - 0.5) % 1.0 + utc[1], 0.0, 0.0, 0.0))


def _et_by_astropy(value: str | float, form: str, scale: str, text: str, seconds: float = 0.0) -> float:
    from astropy.time import Time, TimeDelta
    from astropy.utils.iers import conf

    after_s = seconds + (GPS_BEHIND_TAI_S if scale == "gps" else 0.0)
    offline = conf.set_temp("auto_download", False) if scale == "ut1" else nullcontext()
    try:
        with offline:
            time = Time(value, format=form, scale="tai" if scale == "gps" else scale)
            if after_s:
                time = time + TimeDelta(after_s, format="sec")
            return float((time.tdb - Time(J2000_TT_JD, format="jd", scale="tdb")).sec)
    except (ValueError, IndexError) as error:
        why = " (UT1 is not known then)" if scale == "ut1" else ""
        raise ValueError(f"{text!r} is no {scale.upper()} such as {EXAMPLE}{why}") from error


def _is_leap_second(day: date, hour: str, minute: str, scale: str) -> bool:
    """Whether second 60 of a minute is UTC's leap second at the end of a day."""
    import erfa

    after = day + timedelta(1)
    known = {(int(entry["year"]), int(entry["month"])) for entry in erfa.leap_seconds.get() if entry["year"] >= 1972}
    return scale == "utc" and (hour, minute) == ("23", "59") and after.day == 1 and (after.year, after.month) in known


def utc_from_et(et: float) -> str:
    """ISO UTC with microseconds and a trailing Z for TDB seconds past J2000."""
    import erfa

    days, seconds = divmod(et, DAY_S)
    if 1 < days / 365.25 + 2000 - KNOWN_YEARS.start < len(KNOWN_YEARS) - 1:
        jd, more = J2000_TT_JD + days, seconds / DAY_S
        utc = erfa.taiutc(*erfa.tttai(*erfa.tdbtt(jd, more, _tdb_less_tt_s(jd, more))))
        year, month, day, clock = erfa.d2dtf("UTC", 6, *utc)
        hour, minute, second, micro = clock.tolist()
        return f"{year:04d}-{month:02d}-{day:02d}T{hour:02d}:{minute:02d}:{second:02d}.{micro:06d}Z"
    from astropy.time import Time, TimeDelta

    time = Time(J2000_TT_JD, format="jd", scale="tdb") + TimeDelta(et, format="sec", scale="tdb")
    utc = time.utc
    utc.precision = 6
    return f"{utc.isot}Z"


def now_utc() -> str:
    """The present moment as ISO UTC, for provenance."""
    return datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
