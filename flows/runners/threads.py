"""Threads of this process: the heavy parts (Mitsuba, numpy, OpenCV) release the interpreter's lock."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from typing import Any


class ThreadsRunner:
    """See `flows.runners.base.Runner`."""

    shares_memory = True

    def __init__(self, pool: ThreadPoolExecutor, workers: int) -> None:
        self._pool = pool
        self._workers = workers

    def images_at_a_time(self) -> int:
        """Threads."""
        return self._workers

    def submit(self, name: str, work: Callable[..., Any], *arguments: Any) -> Future[Any]:  # noqa: ARG002
        """In a thread with a copy of the flow's context: its tasks belong to this flow run."""
        return self._pool.submit(copy_context().run, work, *arguments)


@contextmanager
def threads_runner(workers: int) -> Iterator[ThreadsRunner]:
    """Threads; when the block is interrupted, work that has not begun is dropped."""
    count = max(workers, 1)
    pool = ThreadPoolExecutor(max_workers=count, thread_name_prefix="image")
    try:
        yield ThreadsRunner(pool, count)
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()
