"""Functions compiled by numba, their machine code kept on disk."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

# What may be done to floating-point sums and quotients where the last digits do not matter; NaN and inf stay what they
# are.
REORDERED = {"reassoc", "contract", "arcp", "nsz"}


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile with numba and keep the machine code on disk, beside the source or in the user's cache folder; where
    neither can be written (a read-only container), compile anew in each process."""
    return _compiled(function)


def compiled_reordered(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same, with arithmetic that may be reordered for speed."""
    return _compiled(function, fastmath=REORDERED)


def _compiled(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    import numba

    try:
        dispatcher = numba.njit(cache=True, nogil=True, error_model="numpy", **options)(function)
    except RuntimeError:
        return numba.njit(nogil=True, error_model="numpy", **options)(function)
    _forget_older(Path(dispatcher.stats.cache_path), function)
    return dispatcher


def _forget_older(folder: Path, function: Callable[..., Any]) -> None:
    """Remove kept machine code of `function` that is older than a file whose compiled functions it calls: numba itself
    looks at the function's own file only."""
    files = _files_called(function, set()) - {Path(function.__code__.co_filename)}
    if not files:
        return
    newest = max(file.stat().st_mtime for file in files)
    name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}-*.nb?"
    for kept in folder.glob(name):
        with suppress(OSError):
            if kept.stat().st_mtime < newest:
                kept.unlink()


def _files_called(function: Callable[..., Any], known: set[Path]) -> set[Path]:
    """Files of the compiled functions that the module of `function` knows by name, and of those that these know."""
    known.add(Path(function.__code__.co_filename))
    for value in list(function.__globals__.values()):
        called = getattr(value, "py_func", None)
        if called is not None and Path(called.__code__.co_filename) not in known:
            _files_called(called, known)
    return known
