"""What was fetched: content, size and time of every file, so that a later run need not read all of them again."""

import json
import os
import threading
import uuid
from pathlib import Path
from typing import Any

from catalog.digest import sha256_of_file
from catalog.times import now_utc

LEDGER = "fetched.json"


class Ledger:
    """The record `fetched.json` of a folder of fetched files. A damaged or foreign one counts as empty."""

    def __init__(self, archive: Path) -> None:
        self._file = archive / LEDGER
        self._lock = threading.Lock()
        self._entries: dict[str, dict[str, Any]] = {}
        self._changed: dict[str, dict[str, Any]] = {}
        self._entries = self._read()

    def _read(self) -> dict[str, dict[str, Any]]:
        try:
            content = json.loads(self._file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return {k: v for k, v in content.items() if isinstance(v, dict)} if isinstance(content, dict) else {}

    def sha256(self, path: str) -> str | None:
        """Content of a file as it was fetched, None when it was not."""
        return self._entries.get(path, {}).get("sha256")

    def content_of(self, path: str, file: Path) -> str | None:
        """sha256 of a file that is there, from the record while its size and time are those of the record."""
        if not file.is_file():
            return None
        stat, entry = file.stat(), self._entries.get(path, {})
        if (entry.get("bytes"), entry.get("mtime_ns")) == (stat.st_size, stat.st_mtime_ns):
            return str(entry["sha256"])
        return sha256_of_file(file)

    def note(self, path: str, file: Path, sha256: str, source: str) -> None:
        """Record a file that has been fetched."""
        stat = file.stat()
        entry = {"sha256": sha256, "bytes": stat.st_size, "mtime_ns": stat.st_mtime_ns, "source": source}
        with self._lock:
            self._entries[path] = self._changed[path] = entry | {"fetched": now_utc()}

    def save(self) -> None:
        """Write what was noted, beside what others noted meanwhile; whole or not at all."""
        with self._lock:
            if not self._changed:
                return
            content = self._read() | self._changed
            temporary = self._file.with_name(f".{uuid.uuid4().hex}.json")
            temporary.write_text(json.dumps(content, indent=0, sort_keys=True), encoding="utf-8")
            os.replace(temporary, self._file)
            self._changed = {}
