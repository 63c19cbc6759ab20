"""The processes that images are done in: as many as there are images at a time, each kept for the next image, and ended
when an image takes too much time or memory.

The processes are loky's: they have an environment of their own and do not run the main script again. Time and memory
are measured from outside, for a step in a C library would not let its own process do so.
"""

import atexit
import multiprocessing
import signal
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
from loky.backend import get_context

from flows.reprocessing.worker import work
from tasks.atomic import sweep_temporaries

Message = dict[str, Any]
Tell = Callable[[Message], None]
PROCESS_NAME = "planetpose-image"
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
LOOK_EVERY_S = 1.0
END_TIMEOUT_S = 5.0
RECYCLE_AT = 0.6  # of the memory that an image may take: a process that keeps as much is replaced


class LostError(Exception):
    """A process did not bring an image to its end. code: `timed-out`, `memory`, `worker-died`, or `interrupted`:
    the pool was closed before it was begun."""

    def __init__(self, code: str, text: str) -> None:
        self.code = code
        super().__init__(f"{code}: {text}")


class Worker:
    """One process. threads: that Mitsuba and OpenCV may use; those of BLAS would only wait. target: what it runs."""

    def __init__(self, threads: int = 1, target: Callable[..., None] = work) -> None:
        multiprocessing.current_process().daemon = False  # Dask's are, which may have no children
        self._connection, theirs = get_context("loky").Pipe()
        environment = {**ONE_THREAD, "OPENCV_FOR_THREADS_NUM": str(threads), "PYTHONSAFEPATH": "1"}
        self._process = get_context("loky").Process(
            target=target, args=(theirs, threads), name=PROCESS_NAME, env=environment, daemon=True
        )
        self._process.start()
        theirs.close()
        self._folders: set[Path] = set()

    @property
    def pid(self) -> int:
        """The process's number."""
        return int(self._process.pid)

    @property
    def is_alive(self) -> bool:
        """Whether the process runs."""
        return bool(self._process.is_alive())

    def do(self, job: Mapping[str, Any], tell: Tell) -> Message:
        """The worker's last message about a job; `tell` is called with those before it. Raises LostError when there is
        none: the process died, or took more than `image_timeout_s` or `image_memory_mb` of the job; it is dead then,
        and what it left is swept away."""
        self._folders.clear()
        ended = False
        try:
            end = self._end_of(job, tell)
            ended = True
        finally:
            if not ended:
                self.kill()
        return end

    def _end_of(self, job: Mapping[str, Any], tell: Tell) -> Message:
        step, limit_s = "start", job["image_timeout_s"]
        deadline, next_look = time.monotonic() + limit_s, 0.0
        try:
            self._connection.send(dict(job))
            while True:
                message = self._connection.recv() if self._connection.poll(LOOK_EVERY_S) else {"kind": "none"}
                kind = message["kind"]
                if kind == "end":
                    return dict(message)
                if kind in ("begin", "waiting"):  # the wait for another process is not the image's
                    deadline = time.monotonic() + limit_s
                elif kind == "step":
                    step = message["step"]
                    self._folders |= {Path(message["folder"])} if "folder" in message else set()
                if kind != "none":
                    tell(message)
                now = time.monotonic()
                if now > deadline:
                    text = f"step {step} was at work when the image's {limit_s:g} s were over; its process was killed."
                    raise LostError("timed-out", text)
                if now >= next_look:
                    next_look = now + LOOK_EVERY_S
                    self._check_memory(step, job["image_memory_mb"])
        except (EOFError, OSError) as error:
            fault = f"the process died in step {step} ({self._how_it_ended()})."
            raise LostError("worker-died", fault) from error

    def _check_memory(self, step: str, allowed_mb: float) -> None:
        with suppress(psutil.NoSuchProcess):
            used_mb = psutil.Process(self.pid).memory_info().rss / 2**20
            if used_mb > allowed_mb:
                text = f"step {step} took {used_mb:.0f} MB, allowed {allowed_mb:.0f} MB; its process was killed."
                raise LostError("memory", text)

    def _how_it_ended(self) -> str:
        self._process.join(END_TIMEOUT_S)
        code = self._process.exitcode
        if code is None:
            return "it closed its connection"
        return f"signal {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"

    def kill(self) -> None:
        """End the process and all that it started, now, and delete the temporaries that it leaves."""
        if self.is_alive:  # the number of an ended process may be another one's by now
            with suppress(psutil.NoSuchProcess):
                process = psutil.Process(self.pid)
                for each in [*process.children(recursive=True), process]:
                    each.kill()
        self._process.join()
        self._connection.close()
        for folder in self._folders:
            sweep_temporaries(folder)

    def end(self) -> None:
        """End the process, which has nothing to do."""
        self._connection.close()
        self._process.join(END_TIMEOUT_S)
        if self.is_alive:
            self.kill()


class Pool:
    """Processes that are started when they are needed; used by several threads."""

    def __init__(self) -> None:
        self._idle: list[Worker] = []
        self._at_work: set[Worker] = set()
        self._lock = threading.Lock()
        self.is_closed = False

    def do(self, job: Mapping[str, Any], tell: Tell) -> Message:
        """Have a job done, see `Worker.do`; `threads` of it are those that a new process's libraries may use. Raises
        LostError."""
        worker = self._taken(int(job.get("threads", 1)))
        try:
            answer = worker.do(job, tell)
        finally:
            with self._lock:
                self._at_work.discard(worker)
        is_large = (answer.get("resident_mb") or 0.0) > RECYCLE_AT * job["image_memory_mb"]
        with self._lock:
            is_kept = not (self.is_closed or is_large)
            if is_kept:
                self._idle.append(worker)
        if not is_kept:
            worker.end()
        return answer

    def _taken(self, threads: int) -> Worker:
        with self._lock:
            if self.is_closed:  # an image of the task runner's queue: its run is ended
                raise LostError("interrupted", "the run was ended before the image was begun.")
            alive = [worker for worker in self._idle if worker.is_alive]
            worker = alive.pop() if alive else Worker(threads)
            self._idle = alive
            self._at_work.add(worker)
        return worker

    def open(self) -> None:
        """Take jobs (again)."""
        self.is_closed = False

    def close(self) -> None:
        """End all processes, those at work by force."""
        with self._lock:
            self.is_closed = True
            idle, at_work, self._idle = self._idle, list(self._at_work), []
        for worker in at_work:
            worker.kill()
        for worker in idle:
            worker.end()


pool = Pool()
atexit.register(pool.close)
