"""The time of exposure: of all that a label says what agrees is used, the rest reported; no wrong time in silence."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy.io import fits
from astropy.time import Time, TimeDelta
from hypothesis import given, settings
from hypothesis import strategies as st
from small_vicar import fits_with, voyager_with_label

from catalog.errors import RefusedError
from catalog.observation import Frame, Quality
from catalog.pose import PartialPose
from catalog.readers import read_frame
from catalog.readers.exposure_time import claim, exposure_time
from catalog.readers.fits_time import fits_exposure_time
from catalog.times import et_from_time, et_from_utc, utc_from_et
from tasks.ingest.pose import initial_pose

J2000 = Time(2451545.0, format="jd", scale="tdb")
DAY, CLOCK = "1997-09-23", "14:05:21"
WHEN = f"{DAY}T{CLOCK}"


def by_astropy(text: str, scale: str) -> float:
    return float((Time(text, scale=scale).tdb - J2000).sec)


def et_of(header: dict[str, Any], comments: dict[str, str] | None = None) -> float | None:
    return fits_exposure_time(header, comments or {}).et


def mjd(text: str) -> float:
    return float(Time(text, scale="utc").mjd)


@pytest.mark.parametrize("scale", ["utc", "tdb", "tt", "tai", "ut1", "tcb", "tcg"])
def test_timesys_is_obeyed(scale: str) -> None:
    found = et_of({"DATE-OBS": WHEN, "TIMESYS": scale.upper()})
    assert found == pytest.approx(by_astropy(WHEN, scale), abs=1e-5)


@pytest.mark.parametrize(
    "day", ["1997/09/23", "1997-SEP-23", "1997 Sep 23", "23-SEP-1997", "23 September 1997", "1997-266"]
)
def test_days_of_other_spellings(day: str) -> None:
    for header in (
        {"DATE-OBS": f"{day} {CLOCK}"},
        {"DATE-OBS": day, "TIME-OBS": CLOCK},
        {"DATE_OBS": f"{day}T{CLOCK}"},
    ):
        assert et_of(header) == pytest.approx(by_astropy(WHEN, "utc"), abs=1e-5), header


def test_the_times_of_pds_labels_in_a_fits_header() -> None:
    found = fits_exposure_time({"START_TIME": f"{DAY}T10:00:00Z", "STOP_TIME": f"{DAY}T10:00:08Z"}, {})
    assert found.et == pytest.approx(by_astropy(f"{DAY}T10:00:04", "utc"), abs=1e-5)
    assert found.source == "START_TIME and STOP_TIME"


def test_timesys_of_other_names() -> None:
    assert et_of({"DATE-OBS": WHEN, "TIMESYS": "GPS"}) == pytest.approx(
        float(((Time(WHEN, scale="tai") + TimeDelta(19.0, format="sec")).tdb - J2000).sec), abs=1e-3
    )
    for name, same in (("ET", "tt"), ("TT(TAI)", "tt"), ("UTC(NIST)", "utc"), ("IAT", "tai"), ("GMT", "utc")):
        assert et_of({"DATE-OBS": WHEN, "TIMESYS": name}) == pytest.approx(by_astropy(WHEN, same), abs=1e-5), name


@pytest.mark.parametrize(
    ("header", "named"),
    [
        ({"DATE-OBS": DAY}, "DATE-OBS = 1997-09-23: it is a day without a time of day"),
        ({"DATE-OBS": "23/09/97"}, "a day without a time of day"),
        ({"DATE-AVG": DAY, "EXPTIME": 3.0}, "DATE-AVG"),
        ({"MJD-OBS": 50714.0}, "MJD-OBS = 50714: it is a day without a time of day"),
        ({"DATE-OBS": DAY, "TIME-OBS": 14.1}, "no time of day such as 14:05:21"),
        ({"DATE-OBS": DAY, "TIME-OBS": "25:05:21"}, "DATE-OBS and TIME-OBS"),
        ({"DATE-OBS": "23/09/1997", "TIME-OBS": CLOCK}, "DATE-OBS = 23/09/1997: it is no time"),
        ({"DATE-OBS": WHEN, "TIMESYS": "LOCAL"}, "TIMESYS = LOCAL"),
        ({"DATE-OBS": WHEN, "TIMESYS": "MARS"}, "TIMESYS = MARS"),
        ({"DATE-OBS": WHEN, "TIMESYS": "TDB", "TREFPOS": "BARYCENTER"}, "TREFPOS = BARYCENTER"),
        ({"DATE-OBS": "2060-01-01T00:00:00", "TIMESYS": "UT1"}, "no time"),
        ({"DATE-OBS": "0000-01-01T00:00:00"}, "DATE-OBS"),
        ({"DATE-OBS": "9999-12-31T23:59:59"}, "DATE-OBS"),
        ({"DATE-OBS": "1970-01-01T00:00:00"}, "clock that was not set"),
        ({"DATE-OBS": "1997-13-23T00:00:00"}, "DATE-OBS"),
        ({"DATE-OBS": "1997-02-30T00:00:00"}, "DATE-OBS"),
        ({"DATE-OBS": "1997-09-23T12:00:60"}, "DATE-OBS"),
        ({"MJD-OBS": -5.5}, "MJD-OBS"),
        ({"MJD": 50714}, "MJD = 50714: it is a day without a time of day"),
        ({"JD": 50714.3}, "JD = 50714.3: it is no time"),
        ({"ET": 4e12}, "ET"),
        ({"DATE-OBS": WHEN, "DATE-AVG": "1987-09-23T14:05:21"}, "contradict"),
    ],
)
def test_what_is_no_time_of_an_exposure_is_none_and_named(header: dict[str, Any], named: str) -> None:
    found = fits_exposure_time(header, {})
    assert found.et is None
    assert named in found.fault


@pytest.mark.parametrize("word", ["UNK", "N/A", "NULL", "", "unknown"])
def test_words_for_the_unknown_say_nothing(word: str) -> None:
    assert (et_of({"DATE-OBS": word}), fits_exposure_time({"DATE-OBS": word}, {}).fault) == (None, "")


@pytest.mark.parametrize(
    ("header", "middle"),
    [
        ({"DATE-OBS": DAY, "TIME-OBS": CLOCK}, 0.0),
        ({"DATE-OBS": "23/09/97", "TIME-OBS": CLOCK}, 0.0),
        ({"DATE-OBS": "23/09/97", "UTSTART": CLOCK, "TIMESYS": "TDB"}, 0.0),
        ({"DATE-OBS": DAY, "TIME-OBS": CLOCK, "EXPTIME": 40.0}, 20.0),
        ({"DATE-BEG": WHEN, "XPOSURE": 40.0}, 20.0),
        ({"DATE-BEG": WHEN, "XPOSURE": 1.0, "TIMEUNIT": "min"}, 30.0),
        ({"DATE-BEG": DAY, "TIME-BEG": CLOCK, "DATE-END": DAY, "TIME-END": "14:06:21"}, 30.0),
        ({"DATE-END": WHEN, "EXPTIME": 40.0}, -20.0),
        ({"DATE-BEG": WHEN, "DATE-END": "1997-09-23T14:07:21", "EXPTIME": 10.0}, 60.0),
        ({"DATE-AVG": WHEN, "DATE-OBS": "1997-09-23T14:05:01", "EXPTIME": 40.0}, 0.0),
        ({"DATE-OBS": WHEN, "TIME-OBS": "01:01:01"}, 0.0),
        ({"DATE-OBS": f"{DAY}T00:00:00", "TIME-OBS": CLOCK}, 0.0),
        ({"DATE-OBS": f"{DAY} 00:00:00.000", "UTC-OBS": CLOCK}, 0.0),
        ({"DATE-BEG": f"{DAY}T00:00", "UTSTART": CLOCK, "EXPTIME": 2.0}, 1.0),
        ({"MJD-AVG": mjd(WHEN)}, 0.0),
        ({"EXPSTART": mjd(WHEN), "EXPEND": mjd(WHEN) + 100 / 86400, "DATE-OBS": DAY, "TIME-OBS": CLOCK}, 50.0),
        ({"TSTART": 100.0, "TSTOP": 140.0, "MJDREFI": 50714, "MJDREFF": mjd(WHEN) - 50714}, 120.0),
        ({"TSTART": 0.0, "EXPTIME": 40.0, "DATEREF": WHEN}, 20.0),
        ({"DATE-OBS": f"{WHEN}Z"}, 0.0),
        ({"MJD": mjd(WHEN)}, 0.0),
        ({"JD": mjd(WHEN) + 2400000.5, "EXPTIME": 40.0}, 20.0),
        ({"DATE-OBS": DAY, "MJD": mjd(WHEN)}, 0.0),
        ({"ET": by_astropy(WHEN, "utc")}, 0.0),
        ({"DATE-OBS": WHEN, "MJD": mjd(WHEN) + 3, "JD": 1.5, "ET": 0.25}, 0.0),
    ],
)
def test_start_middle_and_end_are_kept_apart(header: dict[str, Any], middle: float) -> None:
    found = fits_exposure_time(header, {})
    assert found.et == pytest.approx(et_from_utc(WHEN) + middle, abs=2e-3)
    assert found.contradictions == ()


def test_the_comment_of_date_obs_says_what_it_is_of() -> None:
    header = {"DATE-OBS": WHEN, "EXPTIME": 40.0}
    for comment, middle in (("UTC, middle of the exposure", 0.0), ("end of obs", -20.0), ("calendar start", 20.0)):
        assert et_of(header, {"DATE-OBS": comment}) == pytest.approx(et_from_utc(WHEN) + middle, abs=1e-5)


def test_the_comment_of_a_lone_time_says_what_it_is_of() -> None:
    header = {"MJD": mjd(WHEN), "EXPTIME": 40.0}
    assert et_of(header) == pytest.approx(et_from_utc(WHEN) + 20, abs=2e-3)
    assert et_of(header, {"MJD": "mid-exposure"}) == pytest.approx(et_from_utc(WHEN), abs=2e-3)


def test_midnight_stays_midnight_where_nothing_else_is_a_time_of_day() -> None:
    midnight = f"{DAY}T00:00:00"
    for more in ({}, {"TIME-OBS": "00:00:00"}, {"TIME-OBS": "unknown"}, {"TIME-OBS": 5.0}):
        assert et_of({"DATE-OBS": midnight, **more}) == pytest.approx(et_from_utc(midnight), abs=1e-5), more


@pytest.mark.parametrize("offset", ["+99:99", "+15:00", "-24:00", "+05:60"])
def test_an_offset_that_no_clock_has_makes_no_time(offset: str) -> None:
    assert et_of({"DATE-OBS": f"{WHEN}{offset}"}) is None


def test_leap_seconds_are_times_where_they_are() -> None:
    assert et_from_utc("2016-12-31T23:59:60.5") == pytest.approx(by_astropy("2016-12-31T23:59:60.5", "utc"))
    assert et_from_utc("2016-366T23:59:60.5") == et_from_utc("2016-12-31T23:59:60.5")
    assert et_from_utc("2015-07-14T02:05:00+02:30") == pytest.approx(et_from_utc("2015-07-13T23:35:00Z"), abs=1e-3)
    for text, scale in (("2016-12-31T23:59:60", "tdb"), ("2016-12-30T23:59:60", "utc"), ("2015-366T01:00:00", "utc")):
        with pytest.raises(ValueError, match="no such"):
            et_from_time(text, scale)


def test_a_header_s_time_reaches_the_frame_and_its_fault_the_reason(tmp_path: Path) -> None:
    frame = read_frame(fits_with(tmp_path / "a.fits", {"DATE-OBS": DAY, "TIME-OBS": CLOCK}))
    assert frame.et == et_from_utc(WHEN)
    frame = read_frame(fits_with(tmp_path / "b.fits", {"DATE-OBS": DAY}))
    with pytest.raises(RefusedError, match=r"DATE-OBS = 1997-09-23.*--pose.*utc"):
        initial_pose(frame, None, None, [])  # type: ignore[arg-type]


START, STOP, IMAGE = "1980-12-11T18:57:07.64", "1980-12-11T18:57:23.00", "1980-12-11T18:57:23.00"
MIDDLE = "1980-12-11T18:57:15.32"
SCET = "80.346 18:57:23"


def label(**changed: str) -> dict[str, str]:
    usual = {"START_TIME": START, "STOP_TIME": STOP, "IMAGE_TIME": IMAGE, "EXPOSURE_DURATION": "15.360 <SECOND>"}
    return usual | {"TARGET_NAME": "JUPITER"} | changed


@pytest.mark.parametrize("key", ["START_TIME", "STOP_TIME", "IMAGE_TIME"])
@pytest.mark.parametrize(
    "value",
    ["1970-01-01T00:00:00", "1981-12-11T18:57:23.00", "0000-01-01T00:00:00", "9999-12-31T23:59:59", "1980-346",
     "1980-12-11T18:57:60", "1980-13-11T18:57:23", "1980-12-11T12:57:23.00", "12:00:00", "garbage"],
)  # fmt: skip
def test_one_time_that_contradicts_the_rest_is_left_out_and_reported(key: str, value: str, tmp_path: Path) -> None:
    frame = read_frame(voyager_with_label(tmp_path, label(**{key: value}), SCET, 15360))
    assert frame.et == pytest.approx(et_from_utc(MIDDLE), abs=1.0)
    if value != "1980-346":  # the right day
        assert len(frame.warnings) == 1
        assert key in frame.warnings[0]


@pytest.mark.parametrize("word", ["UNK", "'N/A'", "NULL", '""'])
def test_unknown_times_are_no_contradiction(word: str, tmp_path: Path) -> None:
    frame = read_frame(voyager_with_label(tmp_path, label(STOP_TIME=word), SCET, 15360))
    assert (frame.et, frame.warnings) == (pytest.approx(et_from_utc(MIDDLE), abs=1.0), ())


def test_sound_labels_are_not_doubted(tmp_path: Path) -> None:
    frame = read_frame(voyager_with_label(tmp_path, label(), SCET, 15360))
    assert (utc_from_et(frame.et or 0.0), frame.warnings) == (f"{MIDDLE}0000Z", ())


def test_a_flight_label_that_contradicts_the_label_beside_it_is_reported(tmp_path: Path) -> None:
    frame = read_frame(voyager_with_label(tmp_path, label(), "70.001 00:00:00", 15360))
    assert frame.et == pytest.approx(et_from_utc(MIDDLE), abs=0.1)
    assert "SCET" in frame.warnings[0]


def test_a_wrong_exposure_time_does_not_move_the_middle(tmp_path: Path) -> None:
    frame = read_frame(voyager_with_label(tmp_path, label(EXPOSURE_DURATION="1536.0"), SCET, 15360))
    assert frame.et == pytest.approx(et_from_utc(MIDDLE), abs=0.1)
    assert "EXPOSURE_DURATION" in frame.warnings[0]


def test_where_nothing_agrees_there_is_no_time_and_all_are_named() -> None:
    claims = [*claim("START_TIME", "1980-12-11T18:57:07", "start"), *claim("STOP_TIME", "1981-01-01T00:00:00", "end")]
    found = exposure_time(claims, {"EXPOSURE_DURATION": 15.36})
    assert found.et is None
    for word in ("START_TIME = 1980-12-11T18:57:07", "STOP_TIME = 1981-01-01", "EXPOSURE_DURATION = 15.36 s"):
        assert word in found.fault


SECONDS = st.floats(-8e8, 8e8)


@given(st.lists(st.tuples(SECONDS, st.sampled_from(["start", "middle", "end", "near"])), min_size=1, max_size=5),
       st.floats(0, 1000) | st.none(), st.booleans())  # fmt: skip
@settings(max_examples=150, deadline=None)
def test_a_time_is_one_of_those_stated_and_every_other_one_is_reported(
    stated: list[tuple[float, Any]], length: float | None, gaps: bool
) -> None:
    claims = [c for n, (et, place) in enumerate(stated) for c in claim(f"K{n}", utc_from_et(et), place)]
    found = exposure_time(claims, {"EXP": length}, gaps)
    if found.et is None:
        assert found.fault or not claims
        return
    apart = [abs((c.et or 0.0) - found.et) for c in claims if c.et is not None]
    assert min(apart) <= 7200
    reported = " ".join(found.contradictions)
    assert all(f"says {c} " in reported.replace(",", " ").replace(":", ":") or a <= 7300
               for c, a in zip([c for c in claims if c.et is not None], apart, strict=True))  # fmt: skip


@pytest.mark.parametrize("value", ["{IO, EUROPA}", "(IO, EUROPA)", "{EUROPA, IO}"])
def test_several_targets_are_a_question_that_the_user_answers(value: str, tmp_path: Path) -> None:
    path = voyager_with_label(tmp_path, label(TARGET_NAME=value), SCET, 15360)
    frame = read_frame(path)
    assert frame.target is None
    assert "europa" in frame.unclear["target"]
    assert "io" in frame.unclear["target"]
    assert "frozenset" not in str(frame.label)
    chosen = read_frame(path, target="europa")
    assert (chosen.target, chosen.overruled, chosen.unclear) == ("europa", (), {})
    assert "target io or europa" in " ".join(read_frame(path, target="saturn").overruled).replace(
        "europa or io", "io or europa"
    )


@pytest.mark.parametrize(
    ("value", "target"),
    [("{SKY, EUROPA}", "europa"), ("{'J RINGS', EUROPA}", "europa"), ("{EUROPA}", "europa"), ("{}", None),
     ("('N/A', 'UNK')", None), ("NULL", None), ("{501, 'X RINGS'}", "io")],
)  # fmt: skip
def test_the_one_target_that_is_known_is_meant(value: str, target: str | None, tmp_path: Path) -> None:
    frame: Frame = read_frame(voyager_with_label(tmp_path, label(TARGET_NAME=value), SCET, 15360))
    assert frame.target == target
    assert isinstance(frame.label_pose, PartialPose)


def test_another_pipeline_s_flags_are_left_alone_and_reported(tmp_path: Path) -> None:
    image = np.random.default_rng(0).normal(20, 5, (40, 50)).astype(np.float32)

    def read(name: str, marks: dict[str, str], origin: str = "", bits: int = 1) -> Frame:
        plane = fits.ImageHDU(np.full(image.shape, bits, np.int32), fits.Header(marks), name=name)
        primary = fits.PrimaryHDU(image, fits.Header({"ORIGIN": origin} if origin else {}))
        fits.HDUList([primary, plane]).writeto(tmp_path / "a.fits", overwrite=True)
        return read_frame(tmp_path / "a.fits")

    for name in ("QUALITY", "DQ", "MASK", "BPM", "Data quality flags"):
        frame = read(name, {}, "STScI")
        assert not frame.observation.quality.any(), name
        assert name.upper() in frame.warnings[0]
    for frame in (read("QUALITY", {"FLAGS": "planetpose"}, bits=1024), read("QUALITY", {}, "planetpose", 1024)):
        assert (frame.observation.quality == Quality.SUSPECT).all()
        assert frame.warnings == ()
    assert read("NOISE", {}).warnings == ()


def test_flags_that_leave_no_pixel_are_named(tmp_path: Path) -> None:
    image = np.random.default_rng(0).normal(20, 5, (40, 50)).astype(np.float32)
    plane = fits.ImageHDU(np.ones(image.shape, np.int32), fits.Header({"FLAGS": "planetpose"}), name="QUALITY")
    fits.HDUList([fits.PrimaryHDU(image), plane]).writeto(tmp_path / "a.fits")
    with pytest.raises(RefusedError, match=r"a\.fits: 0 of its 2000 .*extension QUALITY.*missing 2000"):
        read_frame(tmp_path / "a.fits")
