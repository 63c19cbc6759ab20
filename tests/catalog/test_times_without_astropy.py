"""Ordinary times are turned into TDB and back without astropy, and come out as by astropy; what a VICAR label needs is
imported without the network libraries behind its parser."""

import subprocess
import sys
from datetime import UTC, datetime

import pytest
from astropy.time import Time, TimeDelta
from hypothesis import given
from hypothesis import strategies as st

from catalog.times import J2000_TT_JD, KNOWN_YEARS, et_from_time, utc_from_et

MOMENTS = st.datetimes(datetime(KNOWN_YEARS[0], 1, 3), datetime(KNOWN_YEARS[-1], 12, 28))


@given(moment=MOMENTS, scale=st.sampled_from(["utc", "tai", "tt", "tdb"]))
def test_a_time_is_the_tdb_that_astropy_gives(moment: datetime, scale: str) -> None:
    expected = (
        Time(moment.isoformat(), format="isot", scale=scale).tdb - Time(J2000_TT_JD, format="jd", scale="tdb")
    ).sec
    assert et_from_time(moment.isoformat(), scale) == pytest.approx(expected, abs=3e-7)


@given(moment=MOMENTS)
def test_tdb_is_the_utc_that_astropy_gives(moment: datetime) -> None:
    et = (moment.replace(tzinfo=UTC) - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds()
    expected = (Time(J2000_TT_JD, format="jd", scale="tdb") + TimeDelta(et, format="sec", scale="tdb")).utc
    expected.precision = 6
    found = utc_from_et(et)
    assert abs((Time(found[:-1], scale="utc") - expected).sec) < 2e-6


@pytest.mark.parametrize(
    "utc", ["2016-12-31T23:59:60.500000Z", "2016-12-31T23:59:59.900000Z", "1972-06-30T23:59:60.000000Z"]
)
def test_the_seconds_about_a_leap_second_go_there_and_back(utc: str) -> None:
    assert utc_from_et(et_from_time(utc, "utc")) == utc


WITHOUT = """
import sys
from catalog.readers.vicar_file import _label_parser
from catalog.times import et_from_utc, utc_from_et
_, label = _label_parser()
assert label("LBLSIZE=400 FORMAT='BYTE' TYPE='IMAGE'", strict=False)["FORMAT"] == "BYTE"
utc_from_et(et_from_utc("2000-05-22T23:52:05.277Z"))
print(sorted(sys.modules.keys() & {"astropy", "requests", "boto3", "google.cloud.storage", "filecache"}))
"""


def test_neither_astropy_nor_the_network_is_imported_for_them() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "[]\n"
