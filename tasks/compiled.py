"""Functions compiled by numba, their machine code kept on disk."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cached_property, update_wrapper
from pathlib import Path
from threading import RLock
from typing import Any

from tasks.atomic import locked

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
    folder = Path(dispatcher.stats.cache_path)
    _forget_older(folder, function)
    _compile_one_at_a_time(dispatcher, folder / f"{_kept_name(function)}.lock")
    return dispatcher


def _compile_one_at_a_time(dispatcher: Any, lock: Path) -> None:
    """Let one process at a time look for kept machine code and, where there is none, compile: workers that start
    together would each compile the same functions, and the later ones now find the first one's."""
    compile_signature = dispatcher.compile

    def compile_alone(signature: Any) -> Any:
        # Threads wait here first: numba's own lock is taken within, and called functions come here again.
        with COMPILING, _only_process(lock):
            return compile_signature(signature)

    dispatcher.compile = compile_alone


@contextmanager
def _only_process(lock: Path) -> Iterator[None]:
    """Hold the lock file; without it where it cannot be made or locked, as on some network disks."""
    with ExitStack() as stack:
        with suppress(OSError):
            lock.parent.mkdir(parents=True, exist_ok=True)
            stack.enter_context(locked(stack.enter_context(lock.open("a"))))
        yield


def _kept_name(function: Callable[..., Any]) -> str:
    """The first part of the names of a function's files in the cache."""
    return f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"


def _forget_older(folder: Path, function: Callable[..., Any]) -> None:
    """Remove kept machine code of `function` that is older than a file whose compiled functions it calls: numba itself
    looks at the function's own file only."""
    files = _files_called(function, set()) - {Path(function.__code__.co_filename)}
    if not files:
        return
    newest = max(file.stat().st_mtime for file in files)
    for kept in folder.glob(f"{_kept_name(function)}-*.nb?"):
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
