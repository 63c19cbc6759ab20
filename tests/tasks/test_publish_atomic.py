"""A product appears whole or not at all: failures, kills, races and readers during an overwrite."""

import errno
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import tasks.atomic
from tasks.atomic import exchange, folder_put_in_place, sweep_temporaries

MEMBERS = 20


def fill(folder, mark):
    for i in range(MEMBERS):
        (folder / f"{i:02d}").write_text(mark)


def failing_write(product):
    with folder_put_in_place(product) as folder:
        fill(folder, "new")
        raise RuntimeError("midway")


def hidden(store):
    return [p.name for p in store.iterdir() if p.name.startswith(".")]


def test_an_exception_leaves_nothing_behind(tmp_path):
    with pytest.raises(RuntimeError, match="midway"):
        failing_write(tmp_path / "product")
    assert list(tmp_path.iterdir()) == []


def test_an_exception_leaves_the_older_product_alone(tmp_path):
    with folder_put_in_place(tmp_path / "product") as folder:
        fill(folder, "old")
    with pytest.raises(RuntimeError, match="midway"):
        failing_write(tmp_path / "product")
    assert (tmp_path / "product" / "00").read_text() == "old"
    assert hidden(tmp_path) == []


@pytest.mark.parametrize("in_one_step", [True, False])
def test_a_new_product_replaces_the_old_one_whole(tmp_path, monkeypatch, in_one_step):
    if not in_one_step:
        monkeypatch.setattr(tasks.atomic, "exchange", lambda *_: False)
    for mark in ("old", "new"):
        with folder_put_in_place(tmp_path / "product") as folder:
            fill(folder, mark)
            if mark == "new":
                (folder / "extra").write_text("new")
    assert {p.read_text() for p in (tmp_path / "product").iterdir()} == {"new"}
    assert len(list((tmp_path / "product").iterdir())) == MEMBERS + 1
    assert hidden(tmp_path) == []


KILLED_WRITER = """
import sys, time
from pathlib import Path
from tasks.atomic import folder_put_in_place
with folder_put_in_place(Path(sys.argv[1])) as folder:
    (folder / "cube.zarr").mkdir()
    print("writing", flush=True)
    time.sleep(3600)
"""


def test_a_killed_writer_leaves_no_product_and_its_remains_are_swept(tmp_path):
    writer = subprocess.Popen([sys.executable, "-c", KILLED_WRITER, str(tmp_path / "product")], stdout=subprocess.PIPE)
    assert writer.stdout.readline().strip() == b"writing"
    sweep_temporaries(tmp_path)
    assert len(hidden(tmp_path)) == 1, "a living writer's folder stays"
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    writer.stdout.close()
    assert not (tmp_path / "product").exists()
    assert len(hidden(tmp_path)) == 1
    with folder_put_in_place(tmp_path / "other") as folder:
        fill(folder, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["other"]


def test_remains_of_another_machine_are_swept_after_a_day(tmp_path):
    foreign = tmp_path / ".product~elsewhere~1~abc.tmp"
    foreign.mkdir()
    sweep_temporaries(tmp_path)
    assert foreign.exists()
    yesterday = time.time() - 25 * 3600
    os.utime(foreign, (yesterday, yesterday))
    sweep_temporaries(tmp_path)
    assert not foreign.exists()


RACING_WRITER = """
import sys
from pathlib import Path
from tasks.atomic import folder_put_in_place
for round in range(30):
    with folder_put_in_place(Path(sys.argv[1])) as folder:
        for i in range(20):
            (folder / f"{i:02d}").write_text(sys.argv[2])
"""


def test_racing_processes_all_succeed_and_one_of_them_stays(tmp_path):
    command = [sys.executable, "-c", RACING_WRITER, str(tmp_path / "product")]
    writers = [subprocess.Popen([*command, mark], stderr=subprocess.PIPE) for mark in ("a", "b", "c")]
    for writer in writers:
        _, errors = writer.communicate(timeout=300)
        assert writer.returncode == 0, errors.decode()
    found = {p.read_text() for p in (tmp_path / "product").iterdir()}
    assert found in ({"a"}, {"b"}, {"c"})
    assert hidden(tmp_path) == []


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux exchanges two folders in one step")
def test_a_reader_finds_every_file_at_every_moment_of_an_overwrite(tmp_path):
    with folder_put_in_place(tmp_path / "product") as folder:
        fill(folder, "0")
    missing, reads, stop = [], 0, threading.Event()

    def read():
        nonlocal reads
        while not stop.is_set():
            for i in range(MEMBERS):
                try:
                    (tmp_path / "product" / f"{i:02d}").read_text()
                except FileNotFoundError:
                    missing.append(i)
                reads += 1

    reader = threading.Thread(target=read)
    reader.start()
    for version in range(40):
        with folder_put_in_place(tmp_path / "product") as folder:
            fill(folder, json.dumps(version))
    stop.set()
    reader.join()
    assert reads > 100
    assert missing == []


def test_only_existing_folders_are_exchanged(tmp_path):
    (tmp_path / "a").mkdir()
    assert not exchange(tmp_path / "a", tmp_path / "b")
    assert (tmp_path / "a").is_dir()


def test_what_the_disk_does_not_take_does_not_take_the_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "product"
    with folder_put_in_place(folder) as temporary:
        (temporary / "part.txt").write_text("old")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("tasks.atomic.os.fsync", full)
    with pytest.raises(OSError, match="No space left"), folder_put_in_place(folder) as temporary:
        (temporary / "part.txt").write_text("new, and lost")
    assert (folder / "part.txt").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["product"]


def test_every_file_is_on_the_disk_before_the_name_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, flushed = tmp_path / "product", []
    real = os.fsync

    def noted(descriptor: int) -> None:
        flushed.append((Path(os.readlink(f"/proc/self/fd/{descriptor}")).name, folder.exists()))
        real(descriptor)

    monkeypatch.setattr("tasks.atomic.os.fsync", noted)
    with folder_put_in_place(folder) as temporary:
        (temporary / "deep").mkdir()
        (temporary / "deep" / "part.txt").write_text("new")
        (temporary / "record.json").write_text("{}")
    before = {name for name, there in flushed if not there}
    assert {"part.txt", "record.json", "deep"} < before
    assert flushed[-1] == (tmp_path.name, True)
