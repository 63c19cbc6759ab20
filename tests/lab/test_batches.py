"""Batches with one image that spoils them: nothing is lost or hangs, and every reason names the file and a remedy."""

from pathlib import Path
from typing import Any

import pytest

from lab.fuzz.batch import faults_of_reason, faults_of_text, spoil_of
from lab.fuzz.batches import Spoiled, spoil_batches, table
from lab.fuzz.spoils import SPOILS, Spoilt

REDUCED = range(0, len(SPOILS), 2)


def test_one_bad_image_spoils_no_batch() -> None:
    found = spoil_batches(REDUCED, seed=4)
    assert [bad for bad in found.bad if not is_only_slow(bad)] == [], table(found)
    assert found.to_dict()["batches"] == len(REDUCED)


def is_only_slow(bad: dict[str, Any]) -> bool:
    """The machine may be busy: seconds are for the benchmark."""
    return bad["outcome"] == "ended" and all(fault.startswith("it took") for fault in bad["faults"])


@pytest.mark.parametrize(
    ("reason", "faults"),
    [
        ("image-unreadable: image x/spoilt.png is a pipe. Give a file.", 0),
        ("image-unreadable: image x/other.png is a pipe. Give a file.", 1),
        ("image-unreadable: image x/spoilt.png is a pipe.", 1),
        ("bug: RecursionError: too deep. Please report it with the log.", 2),
        ("None", 2),
    ],
)
def test_a_reason_has_to_name_file_fault_and_remedy(reason: str, faults: int) -> None:
    spoilt = Spoilt(Path("x/spoilt.png"), Path("x/spoilt.png"))
    assert len(list(faults_of_reason({"reason": reason}, spoilt))) == faults


def test_what_other_readers_of_json_do_not_take_is_seen() -> None:
    assert list(faults_of_text({"reason": "one line", "image": "ä"})) == []
    assert len(list(faults_of_text({"reason": "two\nlines", "image": "\udcff"}))) == 2
    assert len(list(faults_of_text({"reason": None, "range_factor": float("nan")}))) == 1


def test_hangs_crashes_and_faults_are_counted_by_what_spoiled_the_batch() -> None:
    found = Spoiled()
    found.note(0, {"outcome": "ended", "status": "refused", "reason": "r", "seconds": 1.0, "faults": []})
    found.note(1, {"outcome": "hang", "reason": "", "seconds": 120.0})
    found.note(len(SPOILS), {"outcome": "ended", "status": "ok", "reason": None, "seconds": 2.0, "faults": ["lost"]})
    assert dict(found.by_spoil[spoil_of(0)]) == {"refused": 1, "ok": 1}
    assert [bad["number"] for bad in found.bad] == [1, len(SPOILS)]
    assert found.slowest_s == 2.0
    assert "3 batches" in table(found)
