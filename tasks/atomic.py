"""Folders that appear whole under their name, or not at all, and are exchanged without a moment of absence.

What takes a name is on the disk before: after a power cut too, a name stands for a whole folder, old or new.
"""

import ctypes
import errno
import os
import platform
import re
import shutil
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

TEMPORARY_SUFFIX = ".tmp"
ABANDONED_AFTER_S = 24 * 3600.0
FLUSHED_AT_ONCE = 16
AT_FDCWD, RENAME_EXCHANGE = -100, 2  # fcntl.h, linux/fs.h


@contextmanager
def folder_put_in_place(folder: Path, keep: Callable[[], bool] | None = None) -> Iterator[Path]:
    """Yield a new hidden folder beside `folder` that takes its name at the end, unless the block raises.

    An older `folder` is exchanged in one step where the system can (Linux), so that a reader with an open cube always
    finds every chunk; a missing chunk would read as NaN. Of several writers each succeeds, and the last one stays;
    unless `keep` says, at the end, that what is there now is as good: then the first one stays, and nobody who reads
    it is disturbed.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    _sweep_at_times(folder.parent)
    temporary = folder.parent / _temporary_name(folder.name)
    temporary.mkdir()
    try:
        yield temporary
        flush_folder(temporary)
        _put_in_place(temporary, folder, keep)
        _flush_names(folder.parent)
    finally:
        _remove(temporary)


def _remove(path: Path) -> None:
    """Delete a folder or file; of a link the link alone. What cannot be deleted stays."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink(missing_ok=True)


@contextmanager
def file_put_in_place(path: Path) -> Iterator[Path]:
    """Yield the name of a hidden file beside `path` that takes its place at the end, unless the block raises. A reader
    finds the old content or the new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    _sweep_at_times(path.parent)
    temporary = path.parent / _temporary_name(path.name)
    try:
        yield temporary
        flush_file(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def put_in_place_of_any(path: Path) -> Iterator[Path]:
    """Yield the name of a hidden file or folder beside `path`, to be made, that takes its place at the end, unless the
    block raises, be it a file or a folder that is there."""
    _sweep_at_times(path.parent)
    temporary = path.parent / _temporary_name(path.name)
    try:
        yield temporary
        flush_folder(temporary) if temporary.is_dir() else flush_file(temporary)
        if not os.path.lexists(path) or not exchange(temporary, path):
            _exchange_in_two_steps(temporary, path)
        _flush_names(path.parent)
    finally:
        _remove(temporary)


@contextmanager
def locked(file: IO[Any]) -> Iterator[None]:
    """Hold an exclusive lock on an open file; the system gives it free when its holder dies. Where the system has no
    such locks (Windows) nothing is held."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    fcntl.flock(file, fcntl.LOCK_EX)
    try:
        yield
    finally:
        fcntl.flock(file, fcntl.LOCK_UN)


def flush_folder(folder: Path) -> None:
    """Have the system write everything below `folder` to the disk. Raises OSError when it cannot."""
    from concurrent.futures import ThreadPoolExecutor

    files = [Path(place) / name for place, _, names in os.walk(folder) for name in names]
    with ThreadPoolExecutor(FLUSHED_AT_ONCE) as pool:  # a file system writes down several at the cost of one
        list(pool.map(flush_file, files))
        list(pool.map(_flush_names, [Path(place) for place, _, _ in os.walk(folder)]))


def flush_file(path: Path) -> None:
    """Have the system write a file to the disk. Raises OSError when it cannot."""
    descriptor = os.open(path, os.O_RDONLY if os.name == "posix" else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _flush_names(folder: Path) -> None:
    """The same with the names in a folder, where the system knows how."""
    with suppress(PermissionError):  # Windows opens no folder
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTSUP):
                raise
        finally:
            os.close(descriptor)


def _temporary_name(name: str) -> str:
    host = platform.node().replace("~", "-")
    return f".{name}~{host}~{os.getpid()}~{uuid.uuid4().hex[:12]}{TEMPORARY_SUFFIX}"


def without_temporaries(text: str) -> str:
    """A text, with what a temporary stands for in its place: people look for the name that they gave."""
    return re.sub(rf"\.([^/~]+)~[^/~]*~\d+~[0-9a-f]{{12}}{re.escape(TEMPORARY_SUFFIX)}", r"\1", text)


def _put_in_place(temporary: Path, folder: Path, keep: Callable[[], bool] | None) -> None:
    try:
        temporary.rename(folder)
    except OSError:
        if not folder.is_dir():
            raise
        if keep is not None and keep():
            return
        if not exchange(temporary, folder):
            _exchange_in_two_steps(temporary, folder)


def exchange(a: Path, b: Path) -> bool:
    """Exchange two folders' names in one step, by Linux' renameat2. False where the system cannot."""
    if not sys.platform.startswith("linux"):
        return False
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is None:
        return False
    return bool(renameat2(AT_FDCWD, os.fsencode(a), AT_FDCWD, os.fsencode(b), ctypes.c_uint(RENAME_EXCHANGE)) == 0)


def _exchange_in_two_steps(temporary: Path, folder: Path) -> None:
    """Old aside, new in, old away. Another writer may get in between: then his folder, as good as ours, stays."""
    aside = folder.parent / _temporary_name(folder.name)
    with suppress(FileNotFoundError):
        folder.rename(aside)
    try:
        temporary.rename(folder)
    except OSError:
        if not folder.is_dir():
            raise
    finally:
        _remove(aside)


def sweep_temporaries(parent: Path) -> int:
    """Delete what killed writers left in `parent`: those of this machine at once, of others after a day. Returns how
    many names the folder has."""
    try:
        names = os.listdir(parent)
    except OSError:  # not there yet, or somebody else's
        return 0
    for name in names:
        if name[0] == "." and name.endswith(TEMPORARY_SUFFIX) and _is_abandoned(parent / name):
            _remove(parent / name)
    return len(names)


_writes_left: dict[Path, int] = {}


def _sweep_at_times(parent: Path) -> None:
    """Sweep before a writer's first file in a folder, and then once in as many of its files as the folder has: a look
    at all names for each of them would make N products cost N times N."""
    left = _writes_left.get(parent, 0)
    _writes_left[parent] = left - 1 if left > 0 else sweep_temporaries(parent)


def _is_abandoned(path: Path) -> bool:
    _, _, owner = path.name.partition("~")
    host, _, rest = owner.partition("~")
    pid = rest.partition("~")[0]
    if host == platform.node().replace("~", "-") and pid.isdigit():
        return not _runs(int(pid))
    try:
        return time.time() - path.stat().st_mtime > ABANDONED_AFTER_S
    except OSError:
        return False


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
