"""Labels made of the right words in the wrong order: parsed or refused, nothing else."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_vicar import VICAR_LABEL, read_or_refuse

from catalog.readers.pds3_label import parse_label

KEYWORDS = """
    START_TIME STOP_TIME EXPOSURE_DURATION TARGET_NAME FILTER_NAME INSTRUMENT_ID SPACECRAFT_NAME MISSION
    SENSOR EXP FILTER CUT_OUT_WINDOW LAB01 LAB02 NBB FORMAT
    RECSIZE X SCETYEAR OBJECT END_OBJECT ^IMAGE TARGET INSTRUMENT_HOST_NAME
    END PROPERTY TASK EOL
"""
KEYS = st.sampled_from(KEYWORDS.split())
VALUES = st.one_of(
    st.integers().map(str),
    st.floats().map(str),
    st.sampled_from(["GALILEO", "'SSI'", '"CASSINI ORBITER"', "ISSNA", "EUROPA", "VGR-1", "N/A"]),
    st.sampled_from(["", "(", ")", "{}", "<", "-"]),
    st.sampled_from(["2005-068T04:09:08.968Z", "1979-063T19:23:00", "9999-999T99:99:99", "12:60:61", "0000-00-00"]),
    st.lists(st.integers(-3, 900), max_size=5).map(lambda items: f"({','.join(map(str, items))})"),
    st.text(st.characters(max_codepoint=255), max_size=12).map(lambda text: f"'{text}'"),
    st.text(max_size=8),
)  # fmt: skip
UNITS = st.sampled_from(["", " <MS>", " <KM>", " <", " >", " <<>>"])
STATEMENTS = st.lists(st.tuples(KEYS, st.sampled_from([" = ", "=", " ", " == "]), VALUES, UNITS), max_size=12)
quick = settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


@quick
@given(STATEMENTS, st.sampled_from(["\nEND\n", "\r\nEND", "", "\0", "/* ", '"']))
def test_pds3_text_is_a_label_of_plain_values_or_none(statements: list[tuple[str, ...]], end: str) -> None:
    label, fault = {}, ""
    try:
        label = parse_label("\n".join("".join(parts) for parts in statements) + end)
    except ValueError as error:
        fault = str(error)
    assert not fault or "no sound label" in fault
    assert all(isinstance(key, str) for key in label)


@quick
@given(STATEMENTS)
def test_vicar_text_is_read_or_refused(tmp_path: Path, statements: list[tuple[str, ...]]) -> None:
    words = "  ".join(f"{key}{sign}{value}" for key, sign, value, _ in statements).encode("latin-1", "replace")
    size = len(VICAR_LABEL) + len(words) + 50
    label = VICAR_LABEL.replace(b"LBLSIZE=800 ", b"LBLSIZE=%d " % size) + b"  " + words
    (tmp_path / "x.img").write_bytes(label[:size].ljust(size, b"\0") + bytes(60 * 31))
    read_or_refuse(tmp_path / "x.img")


@quick
@given(STATEMENTS)
def test_a_detached_label_of_nonsense_never_stops_an_image(tmp_path: Path, statements: list[tuple[str, ...]]) -> None:
    flight = b"  LAB01='77 VGR-1 FDS 16368.32 PICNO 0548J1-001 SCET 79.063 19:23:00'"
    content = VICAR_LABEL.replace(b"LBLSIZE=800 ", b"LBLSIZE=900 ") + flight
    (tmp_path / "x.img").write_bytes(content.ljust(900, b"\0") + bytes(60 * 31))
    (tmp_path / "x.LBL").write_text("\n".join("".join(parts) for parts in statements), encoding="utf-8")
    read_or_refuse(tmp_path / "x.img")


@pytest.mark.parametrize(
    "value", ["../../x", "/etc/passwd", "$(touch hacked)", "`id`", "a;rm -rf b", "\x1b[31m", "NUL"]
)
def test_label_values_are_only_values(value: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from catalog.readers import read_frame

    monkeypatch.chdir(tmp_path)
    more = f"  TARGET_NAME='{value}'  FILTER_NAME='{value}'".encode().replace(b"\x1b", b" ")
    label = (VICAR_LABEL + more).replace(b"LBLSIZE=800 ", b"LBLSIZE=900 ").ljust(900, b"\0")
    (tmp_path / "x.img").write_bytes(label + bytes(60 * 31))
    frame = read_frame(tmp_path / "x.img")
    assert frame.product == "x"
    assert [path.name for path in tmp_path.iterdir()] == ["x.img"]
