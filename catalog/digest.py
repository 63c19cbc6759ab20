"""Content hashes of files and settings."""

import hashlib
import json
import os
import time
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO

from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.regular_file import ChangedError, check_regular, open_regular

Signature = tuple[int, int, int, int]
BLOCK_BYTES = 1 << 20
SETTLED_NS = 2_000_000_000  # a file changed within the clock's grain after it was read would not show: trust it later


def sha256_of_file(path: Path, max_bytes: int | None = None) -> str:
    """Hex digest of a file's content; remembered while its size, times and inode stay the same. Raises OSError as
    `catalog.regular_file.open_regular`, ChangedError when the file changed meanwhile."""
    check_regular(path, max_bytes)
    resolved = Path(path).resolve()
    _with_digests.update((os.path.abspath(path), str(resolved)))
    return _sha256(str(resolved), signature_of(check_regular(resolved, max_bytes)))


def input_changed(what: str) -> RefusedError:
    """The refusal of a file that something wrote on, or exchanged, while it was worked with; it can pass."""
    error = RefusedError(
        Reason.INPUT_CHANGED, f"{what} changed while it was read.", "Run it again when the file is whole."
    )
    error.__cause__ = ChangedError(Path(what))
    return error


def refuse_changed(path: Path, digest: str, what: str) -> None:
    """Raises RefusedError when the content of a file is not that of `digest` any more, or it is gone."""
    try:
        same = sha256_of_file(path) == digest
    except OSError as error:
        raise input_changed(f"{what} {path}") from error
    if not same:
        raise input_changed(f"{what} {path}")


def signature_of(stat: os.stat_result) -> Signature:
    """What changes when a file's content does: size, times of content and of inode, inode."""
    return stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino


@lru_cache(maxsize=4096)
def _sha256(path: str, signature: Signature) -> str:
    if path in _known and _known[path][0] == signature:
        return _known[path][1]
    with open_regular(Path(path)) as file:
        digest = _digest(file, signature[0])
        if signature_of(os.fstat(file.fileno())) != signature:
            raise ChangedError(Path(path))
    if _keeping and time.time_ns() - max(signature[1], signature[2]) > SETTLED_NS:
        _known[path] = (signature, digest)
        _new.add(path)
    return digest


def _digest(file: BinaryIO, size: int) -> str:
    """Of the first `size` bytes: a file may grow faster than it is read."""
    digest, left = hashlib.sha256(), size
    while left > 0 and (block := file.read(min(left, BLOCK_BYTES))):
        digest.update(block)
        left -= len(block)
    return digest.hexdigest()


_known: dict[str, tuple[Signature, str]] = {}
_keeping: list[Path] = []
_new: set[str] = set()
_with_digests: set[str] = set()


def remember_digests(book: Path) -> None:
    """From now on take digests from the file `book` (as `save_digests` wrote it) where a file is what it was, and keep
    new ones for it. A book that is missing or damaged is an empty one."""
    _keeping[:] = [book]
    try:
        content = json.loads(book.read_text(encoding="utf-8"))
        read = {str(path): (_signature(entry[0]), str(entry[1])) for path, entry in content.items()}
    except (OSError, ValueError, TypeError, LookupError, AttributeError):
        return
    _known.update(read)


def files_with_digests() -> frozenset[str]:
    """Paths of the files that this process knows by their digests."""
    return frozenset(_with_digests)


def learned_digests() -> dict[str, tuple[Signature, str]]:
    """Digests that were found since this was called before, for another process (`learn_digests`)."""
    learned = {path: entry for path, entry in _known.items() if path in _new}
    _new.clear()
    return learned


def learn_digests(learned: dict[str, tuple[Signature, str]]) -> None:
    """Keep what another process found; nothing where digests are not kept."""
    if _keeping:
        _known.update(learned)


def digests_to_save() -> tuple[Path, str] | None:
    """The book of `remember_digests` and its new content; None when digests are not kept."""
    return (_keeping[0], json.dumps(_known)) if _keeping else None


def _signature(values: Any) -> Signature:
    size, mtime_ns, ctime_ns, inode = (int(value) for value in values)
    return size, mtime_ns, ctime_ns, inode


def sha256_of_json(content: Any) -> str:
    """Hex digest of the canonical JSON of plain values. Raises TypeError for anything else (arrays, paths ...)."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
