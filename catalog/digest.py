"""Content hashes of files and settings."""

import hashlib
import json
import os
import time
from functools import lru_cache
from pathlib import Path
from typing import Any

Signature = tuple[int, int, int, int]
SETTLED_NS = 2_000_000_000  # a file changed within the clock's grain after it was read would not show: trust it later


def sha256_of_file(path: Path) -> str:
    """Hex digest of a file's content; remembered while its size, times and inode stay the same."""
    resolved = str(Path(path).resolve())
    return _sha256(resolved, signature_of(os.stat(resolved)))


def signature_of(stat: os.stat_result) -> Signature:
    """What changes when a file's content does: size, times of content and of inode, inode."""
    return stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino


@lru_cache(maxsize=4096)
def _sha256(path: str, signature: Signature) -> str:
    if path in _known and _known[path][0] == signature:
        return _known[path][1]
    with open(path, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    if _keeping and time.time_ns() - max(signature[1], signature[2]) > SETTLED_NS:
        _known[path] = (signature, digest)
    return digest


_known: dict[str, tuple[Signature, str]] = {}
_keeping: list[Path] = []


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
