"""How every file that somebody names is opened: regular files only, without waiting, and no more bytes than it has.

A named pipe, a socket or a terminal would be waited for without end, a device such as /dev/zero has no end, and a file
that something else writes on could grow for as long as it is read.
"""

import errno
import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

MAX_TEXT_BYTES = 50_000_000  # settings, poses and tables; the largest of the catalog has 0.1 MB
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)
_KINDS: tuple[tuple[Callable[[int], bool], str], ...] = (
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


class NotRegularError(OSError):
    """What was named is there, and is no regular file."""

    def __init__(self, what: str, path: Path) -> None:
        super().__init__(errno.EINVAL, f"it is {what}, not a regular file", str(path))


class TooLargeError(OSError):
    """A file has more bytes than what it is meant to be."""

    def __init__(self, size: int, limit: int, path: Path) -> None:
        super().__init__(errno.EFBIG, f"it has {size} bytes, more than {limit}", str(path))


class ChangedError(OSError):
    """A file changed while it was read; it may be at rest the next time."""

    def __init__(self, path: Path) -> None:
        super().__init__(errno.EAGAIN, "it changed while it was read", str(path))


def check_regular(path: Path, max_bytes: int | None = None) -> os.stat_result:
    """The status of a regular file of at most `max_bytes`; links are followed.

    Raises FileNotFoundError, IsADirectoryError, NotRegularError, TooLargeError, or another OSError when it cannot be
    looked at.
    """
    found = _looked_at(path)
    _check(found, path, max_bytes)
    return found


@contextmanager
def open_regular(path: Path, max_bytes: int | None = None) -> Iterator[BinaryIO]:
    """The open file for the `with` block; what is opened is looked at once more, for it may have been exchanged.

    Raises OSError as `check_regular`, and when it may not be read.
    """
    check_regular(path, max_bytes)  # opening some devices does something
    descriptor = os.open(path, _FLAGS)
    with os.fdopen(descriptor, "rb") as file:
        _check(os.fstat(descriptor), path, max_bytes)
        yield file


def read_regular(path: Path, max_bytes: int | None = None) -> bytes:
    """The content of a file as long as it was when it was opened. Raises OSError as `open_regular`."""
    with open_regular(path, max_bytes) as file:
        return file.read(os.fstat(file.fileno()).st_size)


def read_regular_text(path: Path, max_bytes: int = MAX_TEXT_BYTES, encoding: str = "utf-8") -> str:
    """The text of a file. Raises OSError as `open_regular`, UnicodeDecodeError."""
    return read_regular(path, max_bytes).decode(encoding)


def is_regular(path: Path) -> bool:
    """Whether there is a regular file that can be looked at."""
    try:
        check_regular(path)
    except (OSError, ValueError):
        return False
    return True


def is_folder(path: Path) -> bool:
    """Whether there is a folder that can be looked at; a name that no file can have is none."""
    try:
        return stat.S_ISDIR(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


def _looked_at(path: Path) -> os.stat_result:
    try:
        return os.stat(path)
    except ValueError as error:  # a null character
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path)) from error


def _check(found: os.stat_result, path: Path, max_bytes: int | None) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(found.st_mode):
        what = next((name for is_kind, name in _KINDS if is_kind(found.st_mode)), "something else")
        raise NotRegularError(what, path)
    if max_bytes is not None and found.st_size > max_bytes:
        raise TooLargeError(found.st_size, max_bytes, path)
