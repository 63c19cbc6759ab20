"""Kept answers of commands: said again while nothing changed, and never afterwards."""

import logging
import os
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from catalog import unchanged
from catalog.digest import sha256_of_file
from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.unchanged import Answer, answer_of, answered, keep, watch

COMMAND = ["correct", "image.img", "--store", "out"]
IN_TEN_SECONDS_NS = 10_000_000_000


class Command:
    """A folder with an image, its kernel, a product and a program; and what a command about it read."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.image, self.kernel = folder / "image.img", folder / "kernels" / "a.tls"
        self.chunk = folder / "out" / "image" / "cube.zarr" / "latitude" / "c" / "0"
        self.code, self.book = folder / "program" / "tasks" / "step.py", folder / "out" / ".requests" / "image.json"
        for path in (self.image, self.kernel, self.chunk, self.code, self.book):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("as it was")
        self.answer = Answer()

    def done(self) -> None:
        """The command reads, and ends."""
        assert self.image.read_text()
        assert os.listdir(self.kernel.parent)
        sha256_of_file(self.kernel)
        assert self.book.read_text()
        files = [self.image.parent / "image.lbl", self.kernel.parent]
        keep(self.answer, files, [self.chunk.parents[3]], [self.book.parent])


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    watch()
    made = Command(tmp_path)
    monkeypatch.setattr(sys, "argv", ["planetpose", *COMMAND])
    monkeypatch.setattr(unchanged, "_watching", [time.time_ns() + IN_TEN_SECONDS_NS])  # all files are old enough
    monkeypatch.setattr(unchanged, "_seen", unchanged._seen)
    unchanged._seen.clear()
    monkeypatch.setattr(unchanged, "PROJECT_ROOT", tmp_path / "program")
    monkeypatch.setenv("PLANETPOSE_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return made


def test_an_answer_is_said_again_where_nothing_changed(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    command.answer.say("image: a warning")
    command.answer.say("image: ok", sys.stdout)
    command.answer.status = 1
    capsys.readouterr()
    command.done()
    command.book.write_text("noted by another command")
    assert answered() == 1
    assert capsys.readouterr() == ("image: ok\n", "image: a warning\n")


def same_size_and_time(path: Path) -> None:
    """Other content, hidden as well as a program can: only the time of the inode tells."""
    stat = path.stat()
    path.write_text("as it is?")
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


CHANGES: dict[str, Callable[[Command], object]] = {
    "image": lambda command: same_size_and_time(command.image),
    "image gone": lambda command: command.image.unlink(),
    "kernel known by its digest": lambda command: same_size_and_time(command.kernel),
    "another kernel": lambda command: (command.kernel.parent / "b.tls").touch(),
    "a label beside": lambda command: (command.image.parent / "image.lbl").touch(),
    "chunk": lambda command: same_size_and_time(command.chunk),
    "chunk gone": lambda command: command.chunk.unlink(),
    "another file of the product": lambda command: (command.chunk.parent / "1").touch(),
    "product gone": lambda command: shutil.rmtree(command.chunk.parents[3]),
    "code": lambda command: same_size_and_time(command.code),
    "another module": lambda command: (command.code.parent / "more.py").touch(),
}


@pytest.mark.parametrize("change", CHANGES)
def test_any_change_is_seen(command: Command, change: str) -> None:
    command.done()
    assert answer_of(COMMAND) is not None
    time.sleep(0.02)  # more than the grain of a file system's clock
    CHANGES[change](command)
    assert answer_of(COMMAND) is None


def test_other_words_variables_and_folders_are_other_commands(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command.done()
    assert answer_of([*COMMAND, "--json"]) is None
    with monkeypatch.context() as patch:
        patch.setenv("PLANETPOSE_KERNELS", "elsewhere")
        assert answer_of(COMMAND) is None
    with monkeypatch.context() as patch:
        patch.chdir(tmp_path / "out")
        assert answer_of(COMMAND) is None
    assert answer_of(COMMAND) is not None


def test_nothing_is_kept_after_a_late_change_or_a_logged_warning(
    command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(unchanged, "_watching", [time.time_ns()])
        command.done()
        assert answer_of(COMMAND) is None
    command.answer = Answer().listening()
    logging.getLogger("planetpose").warning("something odd")
    command.done()
    assert answer_of(COMMAND) is None


@pytest.mark.parametrize(
    "content", ["", "{}", "[]", '{"said": 1, "status": 0, "files": {}, "products": [], "trees": []}']
)
def test_a_damaged_answer_is_none(command: Command, content: str) -> None:
    command.done()
    (kept,) = (command.folder / "cache" / unchanged.FOLDER).iterdir()
    kept.write_text(content)
    assert answer_of(COMMAND) is None


def test_the_oldest_answers_go(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unchanged, "MOST_KEPT", 2)
    for number in range(4):
        monkeypatch.setattr(sys, "argv", ["planetpose", *COMMAND, str(number)])
        command.done()
        time.sleep(0.02)
    assert [answer_of([*COMMAND, str(number)]) is not None for number in range(4)] == [False, False, True, True]


def test_without_a_place_for_a_cache_the_command_runs_as_ever(
    command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse() -> Path:
        raise RefusedError(Reason.HOME_UNKNOWN, "HOME is not set.", "Set HOME.")

    monkeypatch.setattr(unchanged, "cache_folder", refuse)
    command.done()
    assert answer_of(COMMAND) is None
