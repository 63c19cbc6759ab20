"""A command under test as a process of its own, and the processes that belong to it."""

import json
import os
import signal
import subprocess
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil

from catalog.children import our_command
from flows.reprocessing.pool import PROCESS_NAME

PLANETPOSE = tuple(our_command())
PATIENCE_S = 300.0
LOOK_EVERY_S = 0.02
KEPT_EVENTS = 2000


class Command:
    """`planetpose reprocess ... --log-json --json`, started. events: the last ones that it sent; stamps: when it sent
    them, by kind; noise: what was none. limit_bytes: no file may grow
    larger."""

    def __init__(
        self, arguments: Sequence[str], environment: Mapping[str, str], limit_bytes: int | None = None
    ) -> None:
        self.events: list[dict[str, Any]] = []
        self.noise: list[str] = []
        self.stamps: dict[str, list[float]] = defaultdict(list)
        self._started, self._ended = time.monotonic(), 0.0
        self._process = subprocess.Popen(
            [*PLANETPOSE, "reprocess", *arguments, "--log-json", "--json"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            stdin=subprocess.DEVNULL,
            env=dict(environment),
            text=True,
            start_new_session=True,
            preexec_fn=None if limit_bytes is None else lambda: _limit_files(limit_bytes),
        )
        self._answer = ""
        self._readers = [threading.Thread(target=read, daemon=True) for read in (self._read_events, self._read_answer)]
        for reader in self._readers:
            reader.start()

    @property
    def pid(self) -> int:
        """The command's process."""
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        """Whether it runs no more."""
        return self._process.poll() is not None

    @property
    def seconds(self) -> float:
        """From its start to its end."""
        return round((self._ended or time.monotonic()) - self._started, 2)

    @property
    def summary(self) -> dict[str, Any] | None:
        """What it printed on stdout, None when that is no summary."""
        try:
            found = json.loads(self._answer)
        except ValueError:
            return None
        return found if isinstance(found, dict) else None

    def await_end(self, patience_s: float | None = None) -> int:
        """Wait for its end; its exit status. Raises subprocess.TimeoutExpired when that takes too long."""
        status = self._process.wait(patience_s)
        self._ended = self._ended or time.monotonic()
        for reader in self._readers:
            reader.join(5.0)
        return status

    def kill(self) -> None:
        """kill -9, it alone."""
        kill(self.pid)
        self._process.wait()

    def workers(self) -> list[int]:
        """The processes that do its images, here or below a Dask worker."""
        return [pid for pid in descendants_of(self.pid) if PROCESS_NAME in command_line(pid)]

    def dask_workers(self) -> list[int]:
        """Workers of its Dask cluster."""
        return [
            pid
            for pid in children_of(self.pid)
            if any(PROCESS_NAME in command_line(child) for child in children_of(pid))
        ]

    def _read_events(self) -> None:
        for line in self._process.stderr or ():
            try:
                event = json.loads(line)
                self.stamps[event["event"]].append(time.monotonic())
            except (ValueError, LookupError, TypeError):
                self.noise.append(line.rstrip())
                continue
            self.events.append(event)
            del self.events[:-KEPT_EVENTS]

    def _read_answer(self) -> None:
        if self._process.stdout is not None:
            self._answer = self._process.stdout.read()
            self._ended = time.monotonic()


def _limit_files(size: int) -> None:
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def kill(pid: int, how: signal.Signals = signal.SIGKILL) -> None:
    """Send a signal, if there is still somebody."""
    with suppress(ProcessLookupError):
        os.kill(pid, how)


def children_of(pid: int) -> list[int]:
    """Processes that `pid` started and that still run (Linux)."""
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):
            found += [int(number) for number in task.read_text().split()]
    return found


def descendants_of(pid: int) -> list[int]:
    """Those, what they started, and so on."""
    children = children_of(pid)
    return children + [below for child in children for below in descendants_of(child)]


def command_line(pid: int) -> str:
    """The words a process was started with."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode("utf-8", "replace")
    return ""


def runs(pid: int) -> bool:
    """Whether a process is there, and not only its exit status."""
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def resident_mb(pid: int) -> float | None:
    """Resident size of a process; None when it is gone."""
    with suppress(psutil.NoSuchProcess):
        return round(psutil.Process(pid).memory_info().rss / 2**20, 1)
    return None


def wait_for(condition: Callable[[], bool], patience_s: float = PATIENCE_S) -> bool:
    """Wait for `condition`, at most so long; whether it came true."""
    deadline = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(LOOK_EVERY_S)
    return True
