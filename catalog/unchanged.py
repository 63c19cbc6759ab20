"""Answers of commands that had nothing to do, kept so that the same command answers at once while everything that it
looked at is as it was.

An answer is kept with the size, times and inode of each file and folder that the command depends on: those that it
opened or listed, those whose content it knew by a digest, its products, and the program itself. Any difference, or
anything that cannot be looked at, leaves the command to run as ever. Imports nothing slow: the launcher asks first.
"""

import hashlib
import io
import json
import logging
import os
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

from catalog.digest import SETTLED_NS, files_with_digests, signature_of
from catalog.errors import PlanetposeError
from catalog.settings import PROJECT_ROOT, cache_folder

FOLDER = "unchanged"
MOST_KEPT = 1000  # answers of some ten kB; the oldest go
PROGRAM = ("catalog", "tasks", "flows", "local_server", "planetpose_launcher.py")
VARIABLES = ("PLANETPOSE_", "PREFECT_", "PYTHON", "XDG_", "HOME", "LANG", "LC_")
READ_EVENTS = ("os.listdir", "os.scandir")
AT_START = tuple(sys.path)  # imports may add to it
_seen: set[str] = set()
_watching: list[int] = []  # when the watch began, ns


@dataclass
class Answer:
    """What a command says, in order: (stdout or stderr, text), and its exit status. whole: nothing else was said."""

    said: list[tuple[str, str]] = field(default_factory=list)
    status: int = 0
    whole: bool = True

    def say(self, text: str, file: TextIO | None = None) -> None:
        """Print a line, to stderr without a file, and note it."""
        print(text, file=file or sys.stderr, flush=True)
        self.said.append(("stdout" if file else "stderr", text))

    def listening(self) -> "Answer":
        """This answer, which is not whole any more when something is logged from now on."""
        logging.getLogger("planetpose").addHandler(_Listener(self))
        return self


class _Listener(logging.Handler):
    def __init__(self, answer: Answer) -> None:
        super().__init__(logging.WARNING)
        self.answer = answer

    def emit(self, record: logging.LogRecord) -> None:
        """Hear of a record, which is one of a warning or more."""
        self.answer.whole &= record.levelno < self.level


def watch() -> None:
    """From now on note which files and folders this process reads."""
    if not _watching:
        _watching.append(time.time_ns())
        sys.addaudithook(_note)


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open":
        path, _, flags = arguments
        if not isinstance(path, int) and isinstance(flags, int) and flags & os.O_ACCMODE == os.O_RDONLY:
            _seen.add(os.fsdecode(path))
    elif event in READ_EVENTS and not isinstance(arguments[0], int):
        _seen.add(os.fsdecode(arguments[0] or "."))


def keep(answer: Answer, files: Iterable[Path], products: Iterable[Path], books: Iterable[Path]) -> None:
    """Keep the answer of this command, which had nothing to do. files: what it depends on beside what it read; those
    that are missing must stay missing. products: folders of which every file must stay as it is. books: folders that
    commands write in when they have nothing to do, too; they decide nothing.

    Nothing is kept where a file changed within the clock's grain before the command began, for a change then would not
    show, where something was logged, or where the cache cannot be written to.
    """
    if not (_watching and answer.whole):
        return
    with suppress(OSError, PlanetposeError):  # the second where there is no place for a cache
        products = [path.absolute() for path in products]
        aside = _program_folders() | {str(cache_folder().absolute()), *(str(path.absolute()) for path in books)}
        read = {os.path.abspath(path) for path in _seen}
        read = {path for path in read if aside.isdisjoint(map(str, (Path(path), *Path(path).parents)))}
        read |= files_with_digests() | {os.path.abspath(path) for path in files}
        known = {path: _signature(path) for path in sorted(read)}
        newest = max((max(entry[1], entry[2]) for entry in known.values() if entry), default=0)
        trees = [_program_digest(), *(_tree_digest(path) for path in products)]
        if None in trees or newest > _watching[0] - SETTLED_NS:
            return
        content = {"said": answer.said, "status": answer.status, "files": known}
        content |= {"products": [str(path) for path in products], "trees": trees}
        file = _file_of(sys.argv[1:])
        file.parent.mkdir(parents=True, exist_ok=True)
        temporary = file.with_name(f"{file.name}.{os.getpid()}.tmp")
        temporary.write_text(json.dumps(content), encoding="utf-8")
        temporary.replace(file)
        _forget_oldest(file.parent)


def answered() -> int | None:
    """Say the kept answer of this command and return its exit status; without one, watch what it reads and return
    None."""
    if (answer := answer_of(sys.argv[1:])) is None:
        watch()
        return None
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(encoding="utf-8", errors="backslashreplace")  # as the command itself writes
    for stream, text in answer.said:
        print(text, file=sys.stdout if stream == "stdout" else sys.stderr, flush=True)
    return answer.status


def answer_of(arguments: list[str]) -> Answer | None:
    """The kept answer of a command; None where there is none, or something is not as it was."""
    try:
        content = json.loads(_file_of(arguments).read_text(encoding="utf-8"))
        trees = [_program_digest(), *(_tree_digest(Path(path)) for path in content["products"])]
        same = trees == content["trees"] and all(_signature(path) == entry for path, entry in content["files"].items())
        if not same or None in trees:
            return None
        return Answer([(str(stream), str(text)) for stream, text in content["said"]], int(content["status"]))
    except (OSError, ValueError, TypeError, LookupError, AttributeError, PlanetposeError):
        return None


def _file_of(arguments: list[str]) -> Path:
    environment = sorted(item for item in os.environ.items() if item[0].startswith(VARIABLES))
    place = [os.getcwd(), sys.executable, sys.version, os.geteuid() if hasattr(os, "geteuid") else 0]
    shown = [stream.isatty() for stream in (sys.stdout, sys.stderr)]
    key = json.dumps([arguments, environment, place, shown])
    return cache_folder() / FOLDER / f"{hashlib.sha256(key.encode(errors='surrogateescape')).hexdigest()}.json"


def _signature(path: str) -> list[int] | None:
    """Size, times and inode; of a folder the times and inode, which change when an entry comes or goes; None of what
    is missing."""
    try:
        found = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return None
    return list(signature_of(found))


def _entries(folder: Path) -> Iterator[tuple[str, os.stat_result]]:
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        for name in sorted(names):
            path = os.path.join(place, name)
            yield path, os.stat(path)


def _tree_digest(folder: Path) -> str | None:
    """Of every file's path, size, times and inode; None of a folder that is missing or empty."""
    found = [(path, *signature_of(stat)) for path, stat in _entries(folder)]
    return hashlib.sha256(json.dumps(found).encode(errors="surrogateescape")).hexdigest() if found else None


def _program_folders() -> set[str]:
    """Folders that the program's own files are in, which its digest stands for, and what is no file."""
    own = {str(PROJECT_ROOT / name) for name in PROGRAM}
    return own | {sys.prefix, os.path.dirname(os.__file__), "/proc", "/sys", "/dev"}


def _program_digest() -> str:
    """Of the program's files, and of the folders in which packages are installed."""
    digest = hashlib.sha256()
    for name in PROGRAM:
        digest.update(f"{_tree_digest(PROJECT_ROOT / name) or _signature(str(PROJECT_ROOT / name))}\0".encode())
    for path in AT_START:
        digest.update(f"{path}\0{_signature(path)}\0".encode(errors="surrogateescape"))
    return digest.hexdigest()


def _forget_oldest(folder: Path) -> None:
    kept = sorted(folder.glob("*.json"), key=lambda path: path.stat().st_mtime)
    for path in kept[: max(len(kept) - MOST_KEPT, 0)]:
        path.unlink(missing_ok=True)
