"""The cached step: keys from inputs, records that appear whole, kill -9, two processes at once."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fake_steps import PUBLISH, READ, SLOW, ImageFile, PublishInputs, ReadInputs, Signs, done

from tasks import step as step_module
from tasks.fields import Content
from tasks.record import RECORD_FILE, read_record
from tasks.step import Step, run
from tasks.work import NoFiles

HERE = Path(__file__).parent


def quiet(step: str, iteration: int, message: str) -> None:
    """A progress that nobody sees."""


@pytest.fixture
def make_step(tmp_path: Path) -> Callable[..., Step]:
    image = tmp_path / "seven.txt"
    image.write_text("7")

    def make(**changes: object) -> Step:
        step = Step(READ, "read", "seven", tmp_path / "cache", ReadInputs(image="seven"), ImageFile(image))
        return replace(step, **changes)

    return make


def test_the_key_depends_on_inputs_and_code_and_on_nothing_else(
    make_step: Callable[..., Step], monkeypatch: pytest.MonkeyPatch
) -> None:
    key = make_step().key
    elsewhere = ImageFile(Path("elsewhere"))
    assert make_step(files=elsewhere, product="other", cache=Path("c"), name="read-2").key == key
    assert make_step(inputs=ReadInputs(n=1, image="seven")).key == key
    assert make_step(inputs=ReadInputs(image="seven", n=2)).key != key
    assert make_step(kind=replace(READ, name="another")).key != key
    assert make_step(kind=replace(READ, schema_version=2)).key != key
    monkeypatch.setattr(step_module, "code_version", lambda module: "newer")
    assert make_step().key != key


class Anything(Content):
    """Inputs of any kind."""

    value: Any


@pytest.mark.parametrize("value", [float("nan"), float("inf"), object()])
def test_an_input_that_is_not_plain_json_is_an_error(make_step: Callable[..., Step], value: object) -> None:
    with pytest.raises((TypeError, ValueError)):
        _ = make_step(inputs=Anything(value=value)).key


def test_a_step_works_once(make_step: Callable[..., Step], work_log: Path) -> None:
    first, second = run(make_step(), quiet), run(make_step(), quiet)
    assert first == second
    assert first.result == {"number": 7.0}
    assert first.seconds >= 0
    assert done(work_log) == ["read"]


def test_the_record_is_plain_json_that_says_what_the_result_depends_on(
    make_step: Callable[..., Step], work_log: Path
) -> None:
    step = make_step()
    run(step, quiet)
    content = json.loads((step.folder / RECORD_FILE).read_text())
    assert content["inputs"] == {"image": "seven", "n": 1}
    assert content["key"] == step.key
    assert set(content) == {"step", "key", "code", "inputs", "result", "seconds", "written"}
    assert done(work_log) == ["read"]


def test_a_step_that_fails_leaves_nothing_behind(make_step: Callable[..., Step], work_log: Path) -> None:
    step = make_step()
    step.files.image.write_text("refuse")
    with pytest.raises(Exception, match="holds no number"):
        run(step, quiet)
    assert [path for path in step.cache.rglob("*") if path.is_file()] == []
    assert list(step.folder.parent.iterdir()) == []
    assert done(work_log) == ["read"]


@pytest.mark.parametrize("damage", ["", "{", '{"step": "read"}', '{"key": "x"}', "[]"])
def test_a_damaged_record_is_done_again(make_step: Callable[..., Step], work_log: Path, damage: str) -> None:
    step = make_step()
    run(step, quiet)
    (step.folder / RECORD_FILE).write_text(damage)
    assert read_record(step.folder, step.key) is None
    assert run(step, quiet).result == {"number": 7.0}
    assert step.record() is not None
    assert done(work_log) == ["read", "read"]


def test_a_result_that_json_cannot_hold_is_an_error_and_leaves_nothing(
    make_step: Callable[..., Step], work_log: Path
) -> None:
    step = make_step()
    step.files.image.write_text("nan")
    with pytest.raises(ValueError, match="JSON"):
        run(step, quiet)
    assert step.record() is None
    assert list(step.folder.parent.iterdir()) == []
    assert done(work_log) == ["read"]


def test_an_older_product_is_exchanged_for_the_new_one(
    make_step: Callable[..., Step], work_log: Path, tmp_path: Path
) -> None:
    product = tmp_path / "store" / "seven"
    published: dict[str, Any] = {"kind": PUBLISH, "files": NoFiles(), "destination": product}
    old = make_step(inputs=PublishInputs(before="1"), **published)
    new = make_step(inputs=PublishInputs(before="2"), **published)
    run(old, quiet)
    run(new, quiet)
    assert new.record() is not None
    assert old.record() is None  # so the old request would publish again
    assert sorted(path.name for path in product.iterdir()) == ["product.txt", RECORD_FILE]
    assert [path.name for path in product.parent.iterdir()] == ["seven"]
    assert done(work_log) == ["publish", "publish"]


SCRIPT = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fake_steps import SLOW, Signs
from tasks.fields import Content
from tasks.step import Step, run
files = Signs(Path(sys.argv[3]), Path(sys.argv[4]))
record = run(Step(SLOW, "slow", "p", Path(sys.argv[2]), Content(), files), lambda *_: None)
print(record.result["pid"])
"""


def start_slow_step(cache: Path, started: Path, go_on: Path) -> subprocess.Popen[str]:
    """Another process that does the step `slow`, until `go_on` exists; returns when it is in the middle."""
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(HERE), str(cache), str(started), str(go_on)],
        stdout=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 300
    while not started.exists():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return process


def test_kill_9_leaves_no_half_result_and_the_next_run_cleans_up(tmp_path: Path, work_log: Path) -> None:
    cache = tmp_path / "cache"
    process = start_slow_step(cache, tmp_path / "started", tmp_path / "never")
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    step = Step(SLOW, "slow", "p", cache, Content(), Signs(tmp_path / "again", tmp_path))
    assert step.record() is None
    assert not step.folder.exists()
    assert len(list(step.folder.parent.iterdir())) == 1  # the killed one's temporary
    assert run(step, quiet).result == {"pid": os.getpid()}
    assert [path.name for path in step.folder.parent.iterdir()] == [step.key]
    assert done(work_log) == ["slow", "slow"]


def test_two_processes_at_the_same_key_both_succeed_with_one_result(tmp_path: Path, work_log: Path) -> None:
    cache = tmp_path / "cache"
    go_on = tmp_path / "go on"
    processes = [start_slow_step(cache, tmp_path / name, go_on) for name in ("a", "b")]
    go_on.touch()
    answers = {process.communicate(timeout=300)[0].strip() for process in processes}
    assert [process.returncode for process in processes] == [0, 0]
    assert len(answers) == 1  # the one who came first
    assert done(work_log) == ["slow", "slow"]
    step = Step(SLOW, "slow", "p", cache, Content(), Signs(tmp_path, tmp_path))
    assert [path.name for path in step.folder.parent.iterdir()] == [step.key]
