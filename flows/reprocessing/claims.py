"""One process at a time works on a product; the others wait, and find its steps done."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from flows.reprocessing.settings import BOOKS

CLAIMS = "claims"
LOOK_EVERY_S = 0.5


@contextmanager
def claimed(store: Path, product: str, waiting: Callable[[], None]) -> Iterator[None]:
    """Hold the claim on a product; `waiting` is called while another process does. The system frees it when its holder
    dies; its file is deleted by whoever gives it back."""
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
