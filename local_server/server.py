"""The local Prefect server of the command line: started once, shared by all commands of its user, stopped when nobody
needs it. It asks for a password that only its user can read.

Prefect needs a server for every flow, and starting one takes 4 to 15 s; so the first command that has work to do starts
one in the background. A keeper process (`local_server.keeper`) owns it and stops it after a time without use. Whether
it lives is known by a lock that keeper and server hold, which also survives neither kill -9 nor a reboot.
"""

import fcntl
import json
import os
import signal
import socket
import subprocess
import threading
import time
import urllib.error
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from filelock import FileLock

from catalog.children import our_module
from catalog.loopback import open_url
from catalog.settings import state_folder
from local_server.reachable import ServerError, Silence, listens, said_when_it_takes_long

START_TIMEOUT_S = 180.0
HEALTH_TIMEOUT_S = 5.0
PATIENCE_S = 40.0
# A server that listens and does not answer for so long hangs: Prefect's answered 0.13 s after it listened, beside 25
# busy processes on two processors, where it took 37 s to listen.
SILENT_S = 12.0
USE_SIGNAL_S = 20.0
IDLE_MINUTES = 15.0


@dataclass(frozen=True)
class ServerRecord:
    """A running server: address of its API, process ids of keeper and server, and USER:PASSWORD."""

    url: str
    keeper_pid: int
    server_pid: int
    credentials: str = ""


@dataclass(frozen=True)
class ServerFiles:
    """Where the server keeps its things, all in one folder."""

    folder: Path

    @property
    def record(self) -> Path:
        """Address and process ids, while it runs."""
        return self.folder / "server.json"

    @property
    def starting_lock(self) -> Path:
        """Held while a command looks for the server or starts it."""
        return self.folder / "server.lock"

    @property
    def alive_lock(self) -> Path:
        """Held by keeper and server as long as one of them lives."""
        return self.folder / "server.alive"

    @property
    def used(self) -> Path:
        """Touched by whoever uses the server."""
        return self.folder / "server.used"

    @property
    def log(self) -> Path:
        """Output of keeper and server."""
        return self.folder / "server.log"

    def read(self) -> ServerRecord | None:
        """The record, or None when there is none that can be read."""
        try:
            return ServerRecord(**json.loads(self.record.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return None

    def write(self, record: ServerRecord) -> None:
        """Replace the record in one go, by a file that its user alone may read."""
        new = self.record.with_suffix(".new")
        new.unlink(missing_ok=True)  # what a killed keeper left may be open to others, or a link
        new.touch(mode=0o600, exist_ok=False)
        new.write_text(json.dumps(asdict(record)) + "\n", encoding="utf-8")
        new.replace(self.record)

    def make(self) -> None:
        """Make the folder, which nobody else may look into: password and database are in it."""
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with suppress(PermissionError):  # it is another one's, who gave us the right to write there
            self.folder.chmod(0o700)

    def touch(self) -> None:
        """Say that the server is in use."""
        self.make()
        self.used.touch()


def server_files() -> ServerFiles:
    """The files of this user's server."""
    return ServerFiles(state_folder() / "server")


def is_held(path: Path) -> bool:
    """Whether some process holds the lock on `path`."""
    try:
        with path.open("a") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return False
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True


def running_server(files: ServerFiles | None = None) -> ServerRecord | None:
    """The server that runs and answers, or None."""
    files = files or server_files()
    record = files.read()
    return record if record and is_held(files.alive_lock) and answers(record.url) else None


def answers(url: str) -> bool:
    """Whether a Prefect API at `url` says that it is well."""
    try:
        with open_url(f"{url}/health", HEALTH_TIMEOUT_S) as reply:
            return bool(reply.status == 200)
    except (OSError, urllib.error.URLError, ValueError):
        return False


def ensure_server(files: ServerFiles | None = None) -> str:
    """Address of the local server's API; starts it when it does not run. Commands that come meanwhile wait for it.

    Raises ServerError naming the log when it does not come up.
    """
    files = files or server_files()
    files.touch()
    with said_when_it_takes_long(lambda: waiting_for(files)), FileLock(files.starting_lock):
        record = running_server(files) or _one_that_is_starting(files)
        if record is None:
            end(files)
            record = _start(files)
    files.touch()
    return record.url


def waiting_for(files: ServerFiles) -> str:
    """What a start of the server has come to, in words."""
    record = files.read()
    if record is None:
        state = "its first start takes 5 to 15 s"
    elif listens(record.url):
        state = f"it listens at {record.url} and does not answer"
    else:
        state = f"it does not listen at {record.url} yet"
    return f"waiting for the local Prefect server: {state} (log: {files.log})"


def _one_that_is_starting(files: ServerFiles) -> ServerRecord | None:
    """The server that an interrupted command has started, once it answers; None when there is none, or it hangs."""
    return _awaited(files, lambda: is_held(files.alive_lock), PATIENCE_S)[0]


def _awaited(files: ServerFiles, lives: Callable[[], bool], patience_s: float) -> tuple[ServerRecord | None, bool]:
    """The server once it answers, None when it does not in time; and whether it listens and keeps silent."""
    deadline, silence, silent = time.monotonic() + patience_s, Silence(), False
    while lives() and time.monotonic() < deadline and not silent:
        if record := running_server(files):
            return record, False
        known = files.read()
        silent = silence.seconds(known.url if known else None) >= SILENT_S
        time.sleep(0.1)
    return None, silent


def _start(files: ServerFiles) -> ServerRecord:
    began, fault = time.monotonic(), "did not start"
    for _ in range(3):  # another process may take the free port before the server does
        keeper = _start_keeper(files, free_port())
        record, silent = _awaited(files, partial(_runs, keeper), START_TIMEOUT_S)
        if record:
            return record
        if _runs(keeper):
            fault = f"takes connections and has not answered for {SILENT_S:.0f} s" if silent else "did not answer"
            keeper.terminate()
            break
    seconds = time.monotonic() - began
    raise ServerError(
        f"the local Prefect server {fault} ({seconds:.0f} s after its start); see {files.log}. "
        "Or use --server embedded."
    )


def _runs(process: subprocess.Popen[bytes]) -> bool:
    return process.poll() is None


def _start_keeper(files: ServerFiles, port: int) -> subprocess.Popen[bytes]:
    """Start keeper and server as a session of their own, so that they outlive this command and its terminal."""
    with files.log.open("ab") as log:
        return subprocess.Popen(
            our_module("local_server.keeper", str(files.folder), str(port), str(idle_minutes() * 60)),
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            cwd="/",
            start_new_session=True,
        )


def idle_minutes() -> float:
    """Minutes without use after which the server stops: PLANETPOSE_SERVER_IDLE_MINUTES, else 15."""
    try:
        return float(os.environ.get("PLANETPOSE_SERVER_IDLE_MINUTES", IDLE_MINUTES))
    except ValueError:
        return IDLE_MINUTES


def free_port() -> int:
    """A TCP port of this machine that nobody uses."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def stop_server(files: ServerFiles | None = None) -> bool:
    """Stop the local server; False when none ran."""
    files = files or server_files()
    files.make()
    with FileLock(files.starting_lock):
        ran = is_held(files.alive_lock)
        end(files)
    return ran


def end(files: ServerFiles) -> None:
    """Stop whatever holds the server's lock (its keeper, or a server that lost its keeper), and forget the record."""
    record = files.read()
    deadline = time.monotonic() + 15
    while record and is_held(files.alive_lock) and time.monotonic() < deadline:
        for pid in (record.keeper_pid, record.server_pid):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGTERM)
        time.sleep(0.2)
    files.record.unlink(missing_ok=True)


@contextmanager
def in_use(files: ServerFiles) -> Iterator[None]:
    """Keep saying that the server is in use, while the `with` block lasts."""
    over = threading.Event()

    def say() -> None:
        while not over.wait(USE_SIGNAL_S):
            files.touch()

    thread = threading.Thread(target=say, daemon=True, name="server-in-use")
    thread.start()
    try:
        yield
    finally:
        over.set()
        files.touch()
