"""The fuzz itself: it sees crashes and hangs where there are some, and damages the same way for the same seed."""

import sys
from pathlib import Path

import numpy as np
import pytest

from lab.fuzz.bench import Damaged, Findings, Original, damaged_files, note, table
from lab.fuzz.corrected import Verdicts, classify
from lab.fuzz.damage import DAMAGES
from lab.fuzz.reader_process import ReaderProcess

STUB = """
import json, sys, time
print(json.dumps({"ready": True}), flush=True)
for line in sys.stdin:
    if "crash" in line: raise SystemError("the reader fell over")
    if "hang" in line: time.sleep(60)
    print(json.dumps({"outcome": "read", "pixels": "1", "metadata": "1"}), flush=True)
"""
CONTENT = b"LBLSIZE=100 NL=30 NS=40 EXPOSURE=12.5 TARGET='EUROPA' " * 40 + np.random.default_rng(0).bytes(25_000)


def test_a_crash_and_a_hang_are_seen_and_the_next_file_is_read() -> None:
    with ReaderProcess(5.0, 10**9, (sys.executable, "-c", STUB)) as reader:
        answers = [reader.ask(Path(name)) for name in ("good", "crash", "good", "hang", "good")]
    assert [answer["outcome"] for answer in answers] == ["read", "crash", "read", "hang", "read"]
    assert "the reader fell over" in answers[1]["reason"]
    findings = Findings()
    damaged = Damaged(Original(Path("x.img"), None), "cut", Path("damaged1.img"))
    for answer in answers:
        note(findings, damaged, answer, answers[0])
    assert [bad["outcome"] for bad in findings.bad] == ["crash", "hang"]
    assert findings.changed == {"nothing changed": 3}
    assert "BAD x.img, cut: crash" in table(findings)


def test_a_reader_that_does_not_start_is_an_error() -> None:
    with (
        ReaderProcess(1.0, 10**9, (sys.executable, "-c", "1 / 0")) as reader,
        pytest.raises(RuntimeError, match="ZeroDivisionError"),
    ):
        reader.ask(Path("good"))


@pytest.mark.parametrize("name", list(DAMAGES))
def test_damage_follows_from_the_seed_and_changes_the_file(name: str) -> None:
    first, again = (DAMAGES[name](CONTENT, np.random.default_rng(3)) for _ in range(2))
    others = {DAMAGES[name](CONTENT, np.random.default_rng(seed)) for seed in range(8)}
    assert first == again
    assert len(others) > 2
    assert others != {CONTENT}


def test_damaged_files_come_one_by_one_and_leave_nothing(tmp_path: Path) -> None:
    image, label = tmp_path / "a.img", tmp_path / "a.lbl"
    image.write_bytes(CONTENT)
    label.write_bytes(b"A = 1\nEND\n" * 20)
    (tmp_path / "out").mkdir()
    untouched = 0
    for damaged in damaged_files([Original(image, label)], 22, 5, tmp_path / "out"):
        beside = damaged.path.with_suffix(".lbl").read_bytes()
        untouched += damaged.path.read_bytes() == CONTENT and beside == label.read_bytes()
    assert untouched <= 3
    assert list((tmp_path / "out").iterdir()) == []


def test_an_ok_that_is_a_pixel_off_is_wrong() -> None:
    verdicts, reported = Verdicts(), []
    damaged = Damaged(Original(Path("x.img"), None), "put in", Path("damaged1.img"))
    sound = {"centre_px": [100.0, 50.0]}
    for result in (
        {"status": "ok", "centre_px": [100.3, 50.4]},
        {"status": "ok", "centre_px": [101.0, 50.5]},
        {"status": "refused", "reason": "unreadable"},
    ):
        classify(verdicts, damaged, result, sound, reported.append)
    assert verdicts.counts == {"ok": 1, "wrong ok": 1, "refused": 1}
    assert len(verdicts.wrong) == 1
    assert "unreadable" in reported[2]
