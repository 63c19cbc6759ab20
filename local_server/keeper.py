"""Keeper of the local Prefect server: starts it, and stops it when it has not been used for a while.

Run by `local_server.server`: python -m local_server.keeper FOLDER PORT IDLE_SECONDS
"""

import fcntl
import os
import secrets
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType

from filelock import FileLock

from catalog.children import their_module
from local_server.serve import AUTHENTICATION, serving_environment
from local_server.server import ServerFiles, ServerRecord

CHECK_EVERY_S = 2.0
STOP_TIMEOUT_S = 10.0
HOST = "127.0.0.1"


def main(folder: Path, port: int, idle_s: float) -> int:
    """Keep a server until it ends, is idle for `idle_s`, or SIGTERM comes."""
    files = ServerFiles(folder)
    with files.alive_lock.open("a") as alive:
        try:
            fcntl.flock(alive, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return 1  # there is a server
        credentials = f"planetpose:{secrets.token_urlsafe(24)}"
        server = start_server(folder, port, alive.fileno(), credentials)
        files.write(ServerRecord(f"http://{HOST}:{port}/api", os.getpid(), server.pid, credentials))
        signal.signal(signal.SIGTERM, lambda *_: stop(server))
        idleness = Idleness(files)
        while server.poll() is None:
            time.sleep(CHECK_EVERY_S)
            stop_when_idle(files, server, idle_s, idleness)
        return 0


def start_server(folder: Path, port: int, alive: int, credentials: str) -> subprocess.Popen[bytes]:
    """Start Prefect's server on this machine's own address. It inherits the lock, so it counts as alive by itself.
    credentials: without them it does nothing, for every user of this machine reaches that address."""
    command = their_module("prefect", "server", "start", "--host", HOST, "--port", str(port))
    environment = server_environment(folder, port) | {AUTHENTICATION: credentials}
    return subprocess.Popen(command, env=environment, pass_fds=(alive,))


def server_environment(folder: Path, port: int) -> dict[str, str]:
    """Environment of the server: its database in `folder`, no pages, and as `serving_environment` has it."""
    defaults = {
        "PREFECT_HOME": str(folder / "prefect"),
        "PREFECT_SERVER_UI_ENABLED": "false",
        "PREFECT_LOGGING_SERVER_LEVEL": "WARNING",
    }
    return serving_environment(HOST, port, {**defaults, **os.environ})


class Idleness:
    """How long nobody has used a server. A sign of use is that its file's time is another one than before, whatever it
    is; the waiting is measured by a clock that nobody sets, so that a jump of the time of day, of minutes or years,
    forwards or back, neither stops a server that is in use nor keeps one for ever."""

    def __init__(self, files: ServerFiles, clock: Callable[[], float] = time.monotonic) -> None:
        self._files, self._clock = files, clock
        self._mark, self._since = self._sign(), clock()

    def seconds(self) -> float:
        """Seconds since the last sign of use was noticed."""
        mark = self._sign()
        if mark != self._mark:
            self._mark, self._since = mark, self._clock()
        return self._clock() - self._since

    def _sign(self) -> int | None:
        try:
            return self._files.used.stat().st_mtime_ns
        except FileNotFoundError:
            return None


def stop_when_idle(files: ServerFiles, server: subprocess.Popen[bytes], idle_s: float, idleness: Idleness) -> None:
    """Stop the server if nobody used it for `idle_s`; no command can be about to use it, for it would hold the lock."""
    if idleness.seconds() < idle_s:
        return
    with FileLock(files.starting_lock):
        if idleness.seconds() >= idle_s:
            files.record.unlink(missing_ok=True)
            stop(server)


def stop(server: subprocess.Popen[bytes], _: FrameType | None = None) -> None:
    """End the server, gently at first."""
    server.terminate()
    try:
        server.wait(STOP_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        server.kill()


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])))
