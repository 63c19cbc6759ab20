"""Functions compiled by numba, their machine code kept on disk."""

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property, update_wrapper
from pathlib import Path
from threading import RLock
from typing import Any

# What may be done to floating-point sums and quotients where the last digits do not matter; NaN and inf stay what they
# are.
REORDERED = {"reassoc", "contract", "arcp", "nsz"}
COMPILING = RLock()


class Compiled:
    """A function that numba compiles when it is called for the first time: importing numba costs most of a second,
    which a command that only reads records need not spend."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        self.py_func = function
        self.options = options
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """What the machine code makes of the arguments."""
        return self.dispatcher(*arguments)

    @cached_property
    def dispatcher(self) -> Any:
        """numba's own. The compiled functions that this one calls by the names of its module become numba's there."""
        with COMPILING:
            names = self.py_func.__globals__
            for name in self.py_func.__code__.co_names:
                if isinstance(called := names.get(name), Compiled) and called is not self:
                    names[name] = called.dispatcher
            return _compiled(self.py_func, **self.options)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile with numba and keep the machine code on disk, beside the source or in the user's cache folder; where
    neither can be written (a read-only container), compile anew in each process."""
    return Compiled(function, {})


def compiled_reordered(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same, with arithmetic that may be reordered for speed."""
    return Compiled(function, {"fastmath": REORDERED})


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
