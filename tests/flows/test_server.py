"""The local server's life: started once, shared, stopped when idle, found again after a crash.

A stub stands in for Prefect's server, which takes 5 to 15 s to start; everything else is the real thing.
"""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from local_server.server import ServerFiles, ServerRecord, ensure_server, is_held, running_server, stop_server

STUB = """
import sys
from http.server import BaseHTTPRequestHandler, HTTPServer
assert sys.argv[1:3] == ["server", "start"]
class Health(BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200 if self.path == "/api/health" else 404)
        self.end_headers()
    def log_message(self, *args):
        pass
HTTPServer(("127.0.0.1", int(sys.argv[sys.argv.index("--port") + 1])), Health).serve_forever()
"""
COMMAND = """
import sys
from pathlib import Path
from local_server.server import ServerFiles, ensure_server
print(ensure_server(ServerFiles(Path(sys.argv[1]))))
"""


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ServerFiles]:
    """A folder for a stub server, which is stopped in the end."""
    stub = tmp_path / "stub" / "prefect"
    stub.mkdir(parents=True)
    (stub / "__init__.py").touch()
    (stub / "__main__.py").write_text(STUB)
    root = Path(__file__).resolve().parents[2]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(stub.parent), str(root)]))
    files = ServerFiles(tmp_path / "state")
    yield files
    stop_server(files)
    assert not is_held(files.alive_lock)


def wait_until(condition: Callable[[], bool], seconds: float = 300.0) -> None:
    """Poll; fails when the condition does not come true."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_it_starts_once_and_is_reused(files: ServerFiles) -> None:
    url = ensure_server(files)
    first = running_server(files)
    assert ensure_server(files) == url
    record = running_server(files)
    assert record is not None
    assert record == first
    assert record.url == url


def test_four_commands_at_once_start_one_server(files: ServerFiles) -> None:
    commands = [
        subprocess.Popen([sys.executable, "-c", COMMAND, str(files.folder)], stdout=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    addresses = {command.communicate(timeout=300)[0].strip() for command in commands}
    assert [command.returncode for command in commands] == [0] * 4
    record = running_server(files)
    assert record is not None
    assert addresses == {record.url}


def test_it_outlives_the_command_that_started_it(files: ServerFiles) -> None:
    command = subprocess.run(
        [sys.executable, "-c", COMMAND, str(files.folder)], stdout=subprocess.PIPE, text=True, check=True
    )
    record = running_server(files)
    assert record is not None
    assert record.url == command.stdout.strip()
    assert os.getsid(record.server_pid) != os.getsid(0)


def test_a_server_whose_starter_was_killed_is_waited_for(files: ServerFiles) -> None:
    command = subprocess.Popen([sys.executable, "-c", COMMAND, str(files.folder)], stdout=subprocess.DEVNULL)
    wait_until(lambda: files.read() is not None)
    command.kill()
    command.wait()
    started = files.read()
    assert started is not None
    assert ensure_server(files) == started.url


def test_stopping_stops_it_and_a_second_time_says_so(files: ServerFiles) -> None:
    ensure_server(files)
    assert stop_server(files)
    assert running_server(files) is None
    assert not is_held(files.alive_lock)
    assert not stop_server(files)


def test_it_stops_by_itself_when_nobody_uses_it(files: ServerFiles, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLANETPOSE_SERVER_IDLE_MINUTES", str(1 / 60))
    ensure_server(files)
    wait_until(lambda: not is_held(files.alive_lock))
    assert files.read() is None


def test_who_uses_it_keeps_saying_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from local_server import server

    files = ServerFiles(tmp_path)
    monkeypatch.setattr(server, "USE_SIGNAL_S", 0.01)
    files.touch()
    with server.in_use(files):
        for _ in range(3):
            os.utime(files.used, (0, 0))
            wait_until(lambda: files.used.stat().st_mtime > 0)


class Reported:
    """A clock that shows what it is set to, and a server that can only be stopped."""

    def __init__(self) -> None:
        self.now, self.stopped = 1000.0, 0

    def __call__(self) -> float:
        return self.now

    def terminate(self) -> None:
        """Stopped."""
        self.stopped += 1

    def wait(self, _: float) -> int:
        """At once."""
        return 0


DAY_S = 24 * 3600.0


@pytest.mark.parametrize("jump_s", [0.0, DAY_S, 400 * DAY_S, -DAY_S, -400 * DAY_S, 3.0, -3.0])
def test_a_jump_of_the_time_of_day_neither_stops_a_server_in_use_nor_keeps_one(tmp_path: Path, jump_s: float) -> None:
    """The file of the last use is marked with the time of day. An hour of use, in which that jumps; then nobody."""
    from local_server.keeper import Idleness, stop_when_idle

    files, reported, of_day = ServerFiles(tmp_path), Reported(), 1.7e9
    files.touch()
    os.utime(files.used, (of_day, of_day))
    idleness = Idleness(files, reported)

    def passes(seconds: float) -> int:
        nonlocal of_day
        reported.now, of_day = reported.now + seconds, of_day + seconds
        stop_when_idle(files, reported, 60.0, idleness)  # type: ignore[arg-type]
        return reported.stopped

    for minute in range(60):
        if minute == 30:
            of_day += jump_s
            assert passes(2.0) == 0
        for _ in range(3):
            os.utime(files.used, (of_day, of_day))
            assert passes(20.0) == 0
    assert passes(38.0) == 0  # 58 s after the last sign of use; 38 s after it was noticed
    of_day += jump_s
    assert passes(1.0) == 0
    assert passes(30.0) == 1


@pytest.mark.parametrize("victim", ["server_pid", "keeper_pid", "both"])
def test_after_kill_9_the_next_command_has_a_server_again(files: ServerFiles, victim: str) -> None:
    ensure_server(files)
    record = files.read()
    assert record is not None
    for pid in [record.server_pid, record.keeper_pid] if victim == "both" else [getattr(record, victim)]:
        os.kill(pid, signal.SIGKILL)
    if victim != "keeper_pid":
        wait_until(lambda: not is_held(files.alive_lock))
    url = ensure_server(files)
    now = running_server(files)
    assert now is not None
    assert now.url == url
    if victim == "keeper_pid":
        assert now == record  # a server that lost its keeper still serves, and `stop` still finds it


def test_a_record_of_another_life_is_not_assumed(files: ServerFiles) -> None:
    files.folder.mkdir(parents=True)
    files.record.write_text('{"url": "http://127.0.0.1:9/api", "keeper_pid": 1, "server_pid": 1}')
    assert running_server(files) is None
    assert ensure_server(files) != "http://127.0.0.1:9/api"  # and process 1 was not touched


def test_a_server_that_cannot_start_is_reported_with_its_log(
    files: ServerFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from local_server import server

    (tmp_path / "stub" / "prefect" / "__main__.py").write_text("raise SystemExit('no database')")
    monkeypatch.setattr(server, "START_TIMEOUT_S", 10.0)
    with pytest.raises(server.ServerError, match=r"server\.log"):
        ensure_server(files)
    assert "no database" in files.log.read_text()


DEAF = """
import socket, sys, time
listener = socket.create_server(("127.0.0.1", int(sys.argv[sys.argv.index("--port") + 1])))
kept = []
while True:
    kept.append(listener.accept())
"""


def test_a_server_that_listens_and_never_answers_ends_with_that_reason(
    files: ServerFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from local_server import server

    (tmp_path / "stub" / "prefect" / "__main__.py").write_text(DEAF)
    monkeypatch.setattr(server, "SILENT_S", 0.5)
    monkeypatch.setattr(server, "HEALTH_TIMEOUT_S", 0.2)
    with pytest.raises(server.ServerError, match=r"takes connections and has not answered.*server\.log"):
        ensure_server(files)
    wait_until(lambda: not is_held(files.alive_lock))  # it was stopped


def test_what_is_waited_for_is_reported_by_what_the_server_has_come_to(files: ServerFiles) -> None:
    from local_server.server import ServerRecord, waiting_for

    assert "its first start takes" in waiting_for(files)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        url = f"http://127.0.0.1:{listener.getsockname()[1]}/api"
        files.folder.mkdir(parents=True)
        files.write(ServerRecord(url, 1, 1))
        assert f"it listens at {url} and does not answer" in waiting_for(files)
    assert f"it does not listen at {url} yet" in waiting_for(files)
    assert str(files.log) in waiting_for(files)
    files.record.unlink()


def test_a_silence_lasts_from_when_a_server_listens(monkeypatch: pytest.MonkeyPatch) -> None:
    from local_server import reachable

    moments = iter(range(100))
    heard = {"listens": False}
    monkeypatch.setattr(reachable, "listens", lambda _: heard["listens"])
    silence = reachable.Silence(lambda: float(next(moments)))
    assert silence.seconds(None) == silence.seconds("http://127.0.0.1:1/api") == 0.0
    heard["listens"] = True
    first, second = silence.seconds("http://127.0.0.1:1/api"), silence.seconds("http://127.0.0.1:1/api")
    assert 0 < first < second
    heard["listens"] = False
    assert silence.seconds("http://127.0.0.1:1/api") == 0.0


def test_nobody_else_can_read_the_password_or_the_database(files: ServerFiles) -> None:
    files.folder.mkdir(parents=True, mode=0o755)  # as an earlier version made it
    ensure_server(files)
    record = files.read()
    assert record is not None
    user, _, password = record.credentials.partition(":")
    assert user
    assert len(password) >= 32
    assert files.folder.stat().st_mode & 0o077 == 0
    assert files.record.stat().st_mode & 0o077 == 0
    first = record.credentials
    assert stop_server(files)
    ensure_server(files)
    again = files.read()
    assert again is not None
    assert again.credentials != first


def test_what_a_killed_keeper_left_does_not_open_the_next_password_to_others(tmp_path: Path) -> None:
    files = ServerFiles(tmp_path)
    elsewhere = tmp_path / "elsewhere"
    for stale in (lambda path: path.touch(mode=0o644), lambda path: path.symlink_to(elsewhere)):
        stale(files.record.with_suffix(".new"))
        files.write(ServerRecord("http://127.0.0.1:1/api", 1, 2, "planetpose:secret"))
        record = files.read()
        assert record is not None
        assert record.credentials == "planetpose:secret"
        assert not files.record.is_symlink()
        assert files.record.stat().st_mode & 0o077 == 0
    assert not elsewhere.exists()


def test_the_local_server_does_nothing_without_its_password(prefect_api: str) -> None:
    """A real server: whoever else reaches its port learns that it lives, and no more."""
    import httpx

    from local_server.server import server_files

    record = server_files().read()
    assert record is not None
    user, _, password = record.credentials.partition(":")
    for credentials, status in ((None, 401), ((user, "wrong"), 401), ((user, password), 200)):
        with httpx.Client(trust_env=False, auth=credentials) as client:
            assert client.post(f"{prefect_api}/flow_runs/filter", json={"limit": 1}).status_code == status
            assert client.get(f"{prefect_api}/health").status_code == 200


def test_a_local_server_that_is_named_by_its_address_gets_its_password(
    prefect_api: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from local_server.prefect_settings import prepare
    from local_server.server import server_files

    record = server_files().read()
    assert record is not None
    monkeypatch.setenv("PREFECT_API_AUTH_STRING", "another:one")
    monkeypatch.setenv("PREFECT_API_URL", prefect_api)
    prepare(prefect_api)
    assert os.environ["PREFECT_API_AUTH_STRING"] == record.credentials
