"""Server and workers of a rehearsal as processes of their own, each in a session that can be killed as a whole."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from catalog.children import our_command, their_module
from local_server.server import answers, free_port

START_TIMEOUT_S = 180.0
STOP_TIMEOUT_S = 30.0
CREDENTIALS = "planetpose:rehearsal-only"


class RehearsalError(Exception):
    """Something did not come about in time."""


def wait_until(what: str, condition: Callable[[], bool], seconds: float = START_TIMEOUT_S) -> float:
    """Wait for a condition; returns the seconds it took. Raises RehearsalError saying `what` did not come about."""
    started = time.monotonic()
    while not condition():
        if time.monotonic() - started > seconds:
            raise RehearsalError(f"after {seconds:.0f} s: {what} did not come about.")
        time.sleep(0.2)
    return time.monotonic() - started


class Session:
    """A process and all that it starts, with its output in a file."""

    def __init__(self, command: list[str], environment: Mapping[str, str], log: Path, folder: Path) -> None:
        with log.open("ab") as output:
            self.process = subprocess.Popen(
                command,
                env=dict(environment),
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        self.log = log

    def lose(self) -> None:
        """What pulling the plug does: SIGKILL to the process and to everything it started."""
        for pid in [self.process.pid, *descendants(self.process.pid)]:
            _signal(pid, signal.SIGKILL)
        self.process.wait()

    def end(self) -> None:
        """SIGTERM, and SIGKILL for what is left after a while."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self.lose()


def descendants(pid: int) -> list[int]:
    """Processes that `pid` started, and those that they did (Linux)."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        parents.setdefault(int(fields[1]), []).append(int(entry.name))
    found, waiting = [], [pid]
    while waiting:
        children = parents.get(waiting.pop(), [])
        found += children
        waiting += children
    return found


def _signal(pid: int, number: signal.Signals) -> None:
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


class Installation:
    """One server on PostgreSQL behind a password, and what its clients need to know, in a folder of its own."""

    def __init__(self, folder: Path, database_url: str, environment: Mapping[str, str]) -> None:
        self.folder = folder
        self.port = free_port()
        self.api_url = f"http://127.0.0.1:{self.port}/api"
        inherited = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
        common = {**inherited, **environment, "DO_NOT_TRACK": "1", "PREFECT_SERVER_ANALYTICS_ENABLED": "false"}
        self._server_environment = {
            **common,
            "PREFECT_HOME": str(folder / "server"),
            "PREFECT_SERVER_DATABASE_CONNECTION_URL": database_url,
            "PREFECT_SERVER_API_AUTH_STRING": CREDENTIALS,
            "PREFECT_SERVER_UI_ENABLED": "false",
            "PREFECT_SERVER_SERVICES_SCHEDULER_LOOP_SECONDS": "5",
        }
        self.client_environment = {
            **common,
            "PREFECT_HOME": str(folder / "client"),
            "PREFECT_API_URL": self.api_url,
            "PREFECT_API_AUTH_STRING": CREDENTIALS,
            "PREFECT_WORKER_QUERY_SECONDS": "2",
            "PREFECT_FLOWS_HEARTBEAT_FREQUENCY": "30",
        }
        for name in ("server", "client"):
            (folder / name).mkdir(parents=True, exist_ok=True)

    def start_server(self) -> Session:
        """Start the server and wait until it answers. Raises RehearsalError with the end of its log."""
        command = our_command("server", "serve", "--port", str(self.port))
        server = Session(command, self._server_environment, self.folder / "server.log", self.folder)
        try:
            wait_until("the server", lambda: answers(self.api_url) or server.process.poll() is not None)
        except RehearsalError:
            server.lose()
            raise
        if server.process.poll() is not None:
            raise RehearsalError(f"the server ended: {server.log.read_text()[-2000:]}")
        return server

    def start_worker(self, pool: str) -> Session:
        """Start a process worker; it takes runs as soon as it is up."""
        command = their_module("prefect", "worker", "start", "--pool", pool, "--type", "process")
        return Session(command, self.client_environment, self.folder / "worker.log", self.folder)

    def run(self, command: list[str], environment: Mapping[str, str], folder: Path | None = None) -> str:
        """Output of a command that uses the server. Raises RehearsalError with what it said when it fails."""
        known = {**self.client_environment, **environment}
        done = subprocess.run(
            command, env=known, cwd=folder or self.folder, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise RehearsalError(f"{' '.join(command)}: {done.stdout}{done.stderr}")
        return done.stdout
