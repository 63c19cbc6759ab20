"""One process at a time works on a product; the others wait, and find its steps done."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from flows.reprocessing.settings import BOOKS

CLAIMS = "claims"
LOOK_EVERY_S = 0.5


@contextmanager
def claimed(store: Path, product: str, waiting: Callable[[], None]) -> Iterator[None]:
    """Hold the claim on a product; `waiting` is called while another process does. The system frees it when its holder
    dies; its file is deleted by whoever gives it back."""
    path = store / BOOKS / CLAIMS / f"{product}.lock"
    path.parent.mkdir(parents=True, exist_ok=True)
    while (held := _try_to_hold(path)) is None:
        waiting()
        time.sleep(LOOK_EVERY_S)
    try:
        yield
    finally:
        path.unlink(missing_ok=True)  # while it is held: who opened it before sees that it is not the file any more
        os.close(held)


def _try_to_hold(path: Path) -> int | None:
    """Descriptor of the claim's file, locked; None when another process holds it, or has just given it back."""
    import fcntl

    held, descriptor = False, os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        held = _is_still(path, descriptor)
    except BlockingIOError:
        return None
    finally:
        if not held:
            os.close(descriptor)
    return descriptor if held else None


def sweep_claims(store: Path) -> int:
    """Delete the claims that killed processes left; how many."""
    import fcntl

    swept = 0
    for path in (store / BOOKS / CLAIMS).glob("*.lock"):
        with suppress(OSError), path.open("r+") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_still(path, file.fileno()):
                path.unlink()
                swept += 1
    return swept


def _is_still(path: Path, descriptor: int) -> bool:
    """Whether the open file is the one of that name."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False
