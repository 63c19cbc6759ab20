"""UTC and TDB without a leap-second kernel, by astropy (which carries the leap seconds)."""

from datetime import UTC, datetime

J2000_TT_JD = 2451545.0


def et_from_utc(utc: str) -> float:
    """TDB seconds past J2000 of an ISO UTC time (`2000-05-22T23:52:05.277Z` or `2015-195T00:35:54.780`).

    Raises ValueError for a text that is no time.
    """
    from astropy.time import Time

    text = utc.strip().removesuffix("Z")
    day_of_year = len(text) > 8 and text[4] == "-" and text[8] == "T"
    try:
        if day_of_year:
            time = Time(f"{text[:4]}:{text[5:].replace('T', ':')}", format="yday", scale="utc")
        else:
            time = Time(text, format="isot", scale="utc")
    except ValueError as error:
        raise ValueError(f"{utc!r} is no UTC such as 2000-05-22T23:52:05.277Z") from error
    return float((time.tdb - Time(J2000_TT_JD, format="jd", scale="tdb")).sec)


def utc_from_et(et: float) -> str:
    """ISO UTC with microseconds and a trailing Z for TDB seconds past J2000."""
    from astropy.time import Time, TimeDelta

    time = Time(J2000_TT_JD, format="jd", scale="tdb") + TimeDelta(et, format="sec", scale="tdb")
    utc = time.utc
    utc.precision = 6
    return f"{utc.isot}Z"


def now_utc() -> str:
    """The present moment as ISO UTC, for provenance."""
    return datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
