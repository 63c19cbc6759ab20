"""Filters of the table know numbers, texts and times, and say what is wrong with them."""

import numpy as np
import pandas as pd
import pytest

from catalog.errors import WrongOptionError
from viewer.filters import filtered

ROWS = {
    "product": ["C1", "C2", "C3", "C4"],
    "status": pd.Categorical(["ok", "doubtful", "ok", "refused"]),
    "camera": pd.Categorical(["voyager1-nac", "voyager2-nac", "galileo-ssi", None]),
    "sigma_px": [0.05, 0.2, np.nan, 1e-3],
    "limb_points": pd.array([10, None, 300, 4], dtype="Int64"),
    "reason": [None, "limb-differs: it is (far) off", None, "no-limb"],
    "utc": pd.to_datetime(["1979-03-04T10:00:00Z", "1979-03-05T10:00:00Z", None, "2000-01-01T00:00:00Z"]),
}
CASES = {
    "": "C1 C2 C3 C4",
    "sigma > 0.1": "C2",
    "sigma>=.05": "C1 C2",
    "sigma < 1e-2": "C4",
    "sigma_px != 0.2": "C1 C4",
    "limb_points <= 10": "C1 C4",
    "not sigma > 0.1": "C1 C3 C4",
    "status = doubtful": "C2",
    "verdict = OK": "C1 C3",
    "status != ok": "C2 C4",
    "camera ~ voyager": "C1 C2",
    "camera !~ voyager": "C3 C4",
    "voyager sigma > 0.1": "C2",
    "voyager and sigma > 0.1 or status = refused": "C2 C4",
    "voyager and (sigma > 0.1 or status = ok)": "C1 C2",
    '"(far)"': "C2",
    "'no-limb'": "C4",
    "utc > 1979-03-05": "C2 C4",
    "utc < 1979-03-04T12:00:00": "C1",
    "utc ~ 1979-03": "C1 C2",
    "product = c3": "C3",
    "reason = ''": "",
    "not (not C1)": "C1",
}


@pytest.fixture
def table() -> pd.DataFrame:
    return pd.DataFrame(ROWS)


@pytest.mark.parametrize(("text", "products"), CASES.items())
def test_rows_that_fit(table: pd.DataFrame, text: str, products: str) -> None:
    assert list(table["product"][filtered(table, text)]) == products.split()


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("sigma > big", "is a number"),
        ("sigmma > 1", "known are sigma"),
        ("sigma >", "lacks a value"),
        ("sigma > > 1", "lacks a value"),
        ("(sigma > 1", "not closed"),
        ("sigma > 1)", "not expected"),
        ("and", "not expected"),
        ("ok or", "ends where"),
        ("> 1", "not expected"),
        ("utc > soon", "is no time"),
        ('"open', "cannot be read"),
        ("x" * 3000, "longer than"),
        ("(" * 900 + "ok", "too many parentheses|ends"),
        ("not " * 400 + "ok", "too many|ends|parentheses"),
    ],
)
def test_a_wrong_filter_is_refused_and_says_how_to_write_one(table: pd.DataFrame, text: str, fault: str) -> None:
    with pytest.raises(WrongOptionError, match=fault) as refusal:
        filtered(table, text)
    assert "sigma > 0.1" in str(refusal.value)
