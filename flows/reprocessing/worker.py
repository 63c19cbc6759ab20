"""A process that corrects one image after the other. It knows no Prefect: the image is Prefect's task.

Jobs and messages are plain dictionaries that go over one connection. The process ends with its parent, in the middle of
a step too: when nobody holds the other end of the connection any more.
"""

import ctypes
import errno
import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import psutil
from filelock import FileLock, Timeout

from catalog.digest import remember_digests
from catalog.errors import PlanetposeError
from flows.chain import Chain
from flows.image import correct_image
from flows.options import BOOKS
from flows.request import Request
from flows.result import result_of
from flows.trace import trace_of
from tasks.boundary import trouble_of
from tasks.objectstore.lease import leased
from tasks.objectstore.location import open_object_store
from tasks.record import RECORD_FILE, Record
from tasks.registry import PUBLISH
from tasks.step import AnyStep, run

Say = Callable[..., None]
CLAIMS = "claims"
DIGESTS = "digests.json"
LOOK_EVERY_S = 0.5
# Trouble of disks, networks and processes that may be gone the next time.
PASSING = """EIO ENOSPC EDQUOT EFBIG ENOMEM EMFILE ENFILE EAGAIN EINTR EBUSY ESTALE ETIMEDOUT ECONNRESET ECONNREFUSED
ECONNABORTED EHOSTUNREACH ENETUNREACH ENETDOWN EPIPE ENOLCK EREMOTEIO EROFS"""
PASSING_ERRNOS = frozenset(getattr(errno, name) for name in PASSING.split() if hasattr(errno, name))
logger = logging.getLogger("planetpose")


class Messages(logging.Handler):
    """The way to the parent, for messages and log records of several threads."""

    def __init__(self, connection: Connection) -> None:
        super().__init__()
        self._connection = connection
        self._sending = threading.Lock()

    def say(self, kind: str, **content: Any) -> None:
        """One message."""
        with self._sending, suppress(BrokenPipeError):  # there is no parent any more: `listen` ends the process
            self._connection.send({"kind": kind, **content})

    def emit(self, record: logging.LogRecord) -> None:
        """A log record as a message, its traceback included."""
        self.say("log", level=record.levelname, text=self.format(record))


def work(connection: Connection, threads: int) -> None:
    """What the process does: jobs, until it is ended. threads: that the renderer may use; the other libraries have
    their number from the environment."""
    os.setsid()  # Ctrl-C of a terminal is for the command, which ends its processes in its own way
    os.dup2(2, 1)
    messages = Messages(connection)
    logger.addHandler(messages)
    logger.propagate = False
    jobs: SimpleQueue[dict[str, Any]] = SimpleQueue()
    threading.Thread(target=listen, args=(connection, jobs), daemon=True, name="listen").start()
    job = jobs.get()
    remember_digests(Path(job["digests"]))
    import drjit

    drjit.set_thread_count(threads)
    while True:
        do(Request.model_validate(job["request"]), messages.say)
        job = jobs.get()


def listen(connection: Connection, jobs: "SimpleQueue[dict[str, Any]]") -> None:
    """Pass jobs on; end the process when nobody can send any more."""
    with suppress(EOFError, OSError):
        while True:
            jobs.put(connection.recv())
    os._exit(0)


def do(request: Request, say: Say) -> None:
    """Correct one image and say how it ended."""
    with claimed(request.store, request.product, lambda: say("waiting"), request.publish_to):
        say("begin")
        started, worked = time.perf_counter(), time.process_time()
        metrics: dict[str, dict[str, Any]] = {}
        chain = Chain(request, lambda step: measured(step, say, metrics))
        error = trouble_of(lambda: correct_image(chain), request.product)
        result, passing = result_of(chain, error), error is not None and can_pass(error)
        for sentence in (*result["guidance"]["overruled"], *result["warnings"]):
            logger.warning("%s: %s", request.product, sentence)
    give_back()
    say(
        "end",
        result=result,
        key=product.key if (product := chain.last(PUBLISH)) else None,
        passing=passing,
        trace=trace_of(chain, failures=not passing),
        steps=metrics,
        seconds=round(time.perf_counter() - started, 3),
        cpu_s=round(time.process_time() - worked, 3),
        resident_mb=psutil.Process().memory_info().rss / 2**20,
    )


def measured(step: AnyStep, say: Say, metrics: dict[str, dict[str, Any]]) -> Record:
    """Run a step, say so, and note its seconds and peak of memory; a cached one is marked as used."""

    def progress(_: str, iteration: int, text: str) -> None:
        say("step", step=step.name, iteration=iteration, text=text)

    say("step", step=step.name, iteration=0, text="", folder=str(step.folder.parent))
    finished = step.record()
    if finished is not None:
        with suppress(OSError):  # it is gone meanwhile, or somebody else's
            os.utime(step.folder / RECORD_FILE)  # for the pruning of the cache
        metrics[step.name] = {"seconds": finished.seconds, "peak_mb": None, "cached": True}
        say("done", step=step.name, **metrics[step.name])
        return finished
    reset_peak()
    started = time.perf_counter()
    try:
        return run(step, progress)
    finally:
        seconds = round(time.perf_counter() - started, 4)
        metrics[step.name] = {"seconds": seconds, "peak_mb": peak_mb(), "cached": False}
        say("done", step=step.name, **metrics[step.name])


def reset_peak() -> None:
    """Begin to measure this process's peak of memory anew, where the system can (Linux)."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_mb() -> float | None:
    """Largest resident size of this process since `reset_peak`; None where the system does not say."""
    try:
        _, _, rest = Path("/proc/self/status").read_text().partition("VmHWM:")
        return round(int(rest.split()[0]) / 1024, 1)
    except (OSError, ValueError, IndexError):
        return None


def give_back() -> None:
    """Give memory that was freed back to the system, where the C library can: what pieces it is in would grow with the
    number of images (measured: 690 MB instead of 1040 MB after ten)."""
    with suppress(AttributeError, OSError, TypeError):  # another C library
        ctypes.CDLL(None).malloc_trim(0)


def can_pass(error: BaseException) -> bool:
    """Whether to try again: trouble of files, memory or networks, also where it was the cause of a refusal of the file;
    never what an image is like."""
    causes: list[BaseException] = []
    cause = error.__cause__ or error.__context__
    while cause is not None and cause not in causes:
        causes.append(cause)
        cause = cause.__cause__ or cause.__context__
    if not isinstance(error, PlanetposeError):
        return any(isinstance(each, OSError | MemoryError) for each in [error, *causes])
    return any(
        isinstance(each, MemoryError | ConnectionError | TimeoutError)
        or (isinstance(each, OSError) and each.errno in PASSING_ERRNOS)
        for each in causes
    )


@contextmanager
def claimed(store: Path, product: str, waiting: Callable[[], None], url: str | None = None) -> Iterator[None]:
    """Hold the claim on a product, so that one process at a time works on it, and the next finds its steps done.
    `waiting` is called while another process holds it. The system frees it when its holder dies; its file is deleted by
    whoever gives it back. url: of the object store that the product goes to; there the claim is a lease."""
    if url is not None:
        with leased(open_object_store(url), product, waiting):
            yield
        return
    path = store / BOOKS / CLAIMS / f"{product}.lock"
    path.parent.mkdir(parents=True, exist_ok=True)
    claim = FileLock(path)
    while not claim.is_locked:
        try:
            claim.acquire(timeout=LOOK_EVERY_S)
        except Timeout:
            waiting()
    try:
        yield
    finally:
        path.unlink(missing_ok=True)  # while it is held: who opened it before finds that it has no name any more
        claim.release()


def sweep_claims(store: Path) -> int:
    """Delete the claims that killed processes left; how many."""
    swept = 0
    for path in (store / BOOKS / CLAIMS).glob("*.lock"):
        with suppress(OSError), FileLock(path, timeout=0):  # Timeout, which is an OSError: its holder lives
            path.unlink()
            swept += 1
    return swept
