"""The worker processes of this process: as many as there are images at a time, kept for the next image."""

import atexit
import threading
from collections.abc import Callable, Mapping
from typing import Any

from flows.reprocessing.settings import Limits
from flows.reprocessing.workman import Message, Workman

RECYCLE_AT = 0.6  # of the memory that an image may take: a process that keeps as much is replaced


class Workforce:
    """Worker processes, hired when they are needed; from several threads."""

    def __init__(self) -> None:
        self._idle: list[Workman] = []
        self._at_work: set[Workman] = set()
        self._closed = False
        self._lock = threading.Lock()

    def do(self, job: Mapping[str, Any], limits: Limits, tell: Callable[[Message], None]) -> Message:
        """Have a job done (see `Workman.do`). Its `threads` are those that a new process's libraries may use. Raises
        LostError."""
        workman = self._hired(int(job.get("threads", 1)))
        try:
            answer = workman.do(job, limits, tell)
        finally:
            with self._lock:
                self._at_work.discard(workman)
        if (answer.get("resident_mb") or 0.0) > RECYCLE_AT * limits.image_memory_mb or self._closed:
            workman.end()
        else:
            with self._lock:
                self._idle.append(workman)
        return answer

    def pids(self) -> list[int]:
        """Numbers of all processes."""
        with self._lock:
            return [workman.pid for workman in (*self._idle, *self._at_work)]

    @property
    def is_closed(self) -> bool:
        """Whether it takes no more jobs."""
        return self._closed

    def open(self) -> None:
        """Take jobs (again)."""
        self._closed = False

    def close(self) -> None:
        """End all processes, those at work by force."""
        with self._lock:
            self._closed = True
            idle, at_work = self._idle, list(self._at_work)
            self._idle = []
        for workman in at_work:
            workman.kill()
        for workman in idle:
            workman.end()

    def _hired(self, threads: int) -> Workman:
        with self._lock:
            while self._idle:
                workman = self._idle.pop()
                if workman.is_alive:
                    break
            else:
                workman = Workman(threads)
            self._at_work.add(workman)
        return workman


workforce = Workforce()
atexit.register(workforce.close)
