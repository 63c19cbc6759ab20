"""One file from its archive into the folder of fetched files, in several attempts: there whole and checked, or not."""

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from catalog.digest import sha256_of_file
from catalog.fetch.ledger import Ledger
from catalog.fetch.rate import RateLimit
from catalog.fetch.settings import FetchSettings
from catalog.fetch.signed import signed
from catalog.fetch.transfer import BLOCK_BYTES, Part, TransferError, transfer
from catalog.lists.location import S3
from catalog.reasons import Reason

INCOMING = ".incoming"


@dataclass(frozen=True)
class Item:
    """One file to have. path: relative to the folder of fetched files. source: its URL, or a file of an offline mirror.
    sha256, bytes: what is known of it. products: who needs it."""

    location: str
    source: str
    path: str
    sha256: str | None = None
    bytes: int | None = None
    products: tuple[str, ...] = ()

    def with_sha256(self, sha256: str | None) -> "Item":
        """The same with a known content."""
        return replace(self, sha256=sha256 or self.sha256)


@dataclass(frozen=True)
class Outcome:
    """What became of an item. status: fetched, present or failed. checked: its content was compared with a checksum
    that was known before. passing: the fault may be gone the next time."""

    item: Item
    status: str
    checked: bool = False
    attempts: int = 0
    reason: str | None = None
    bytes: int | None = None
    sha256: str | None = None
    passing: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        item = self.item
        return {
            "location": item.location, "source": item.source, "path": item.path, "products": list(item.products),
            "status": self.status, "checked": self.checked, "attempts": self.attempts, "reason": self.reason,
            "bytes": self.bytes, "sha256": self.sha256,
        }  # fmt: skip


def fetch_item(
    item: Item, archive: Path, settings: FetchSettings, rate: RateLimit, ledger: Ledger, renew: bool = False
) -> Outcome:
    """Have one file in `archive`; whatever goes wrong with it is stated in the outcome, nothing is raised for it.
    renew: what is there is of an older version."""
    target = archive / item.path
    expected = item.sha256 or ledger.sha256(item.path)
    try:
        digest = None if renew else ledger.content_of(item.path, target)
        if digest is not None and expected in (None, digest):
            return Outcome(item, "present", expected is not None, 0, None, target.stat().st_size, digest)
        with _incoming(archive, item.path) as folder:
            attempts = _attempts(item, folder, target, settings, rate)
        digest = sha256_of_file(target)
        ledger.note(item.path, target, digest, item.source)
        return Outcome(item, "fetched", item.sha256 is not None, attempts, None, target.stat().st_size, digest)
    except TransferError as error:
        attempts = settings.attempts if error.passing else 1
        return Outcome(item, "failed", reason=str(error), attempts=attempts, passing=error.passing)
    except OSError as error:
        return Outcome(item, "failed", reason=f"{Reason.FILE_TROUBLE}: {error}")


@contextmanager
def _incoming(archive: Path, path: str) -> Iterator[Path]:
    """The folder of what has arrived of a file; one process at a time. It goes when the file is whole."""
    import hashlib

    from filelock import FileLock, Timeout

    folder = archive / INCOMING / hashlib.sha256(path.encode()).hexdigest()[:24]
    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / "lock", blocking=False)
    try:
        lock.acquire()
    except Timeout as error:
        raise TransferError("busy", "another process is fetching it", passing=False) from error
    try:
        yield folder
    finally:
        if not (folder / "part").exists():  # what arrived of a file waits for the next run
            shutil.rmtree(folder, ignore_errors=True)
        lock.release()


def _attempts(item: Item, folder: Path, target: Path, settings: FetchSettings, rate: RateLimit) -> int:
    """How many attempts it took. Raises TransferError of the last one."""
    wait_s = settings.first_wait_s
    for attempt in range(1, settings.attempts + 1):
        try:
            _attempt(item, folder, target, settings, rate)
            return attempt
        except TransferError as error:
            if not error.passing or attempt == settings.attempts:
                raise
            time.sleep(min(wait_s if error.wait_s is None else error.wait_s, settings.longest_wait_s))
            wait_s *= 2
    raise TransferError("attempts", "no attempt was made", passing=False)


def _attempt(item: Item, folder: Path, target: Path, settings: FetchSettings, rate: RateLimit) -> None:
    """Pooch compares the content with the checksum, and passes it on only when they agree."""
    import pooch

    part = Part(folder / "part", trusted=item.sha256 is not None)

    def download(url: str, output_file: Any, _: Any) -> None:
        if url.startswith(("http:", "https:")):
            rate.wait(url)
            transfer(url, part, settings, item.bytes)
        elif url.startswith(f"{S3}:"):
            transfer(signed(url), part, settings, item.bytes)
        else:
            copy_from_mirror(Path(url), part, settings, item.bytes)
        os.replace(part.path, output_file)

    pooch.get_logger().setLevel("ERROR")
    known = f"sha256:{item.sha256}" if item.sha256 else None
    try:
        whole = Path(pooch.retrieve(item.source, known, fname="whole", path=folder, downloader=download))
    except ValueError as error:
        part.discard()
        raise TransferError("checksum", f"the content is not what the list says ({error})"[:300], True) from error
    target.parent.mkdir(parents=True, exist_ok=True)
    os.replace(whole, target)


def copy_from_mirror(source: Path, part: Part, settings: FetchSettings, known_bytes: int | None) -> None:
    """The file of a mirror that is a folder, as if it had been transferred."""
    part.discard()
    try:
        size = source.stat().st_size
    except OSError as error:
        raise TransferError("not-in-mirror", f"the mirror has no {source}", passing=False) from error
    if size > settings.largest_bytes or known_bytes not in (None, size):
        wanted = f"allowed are {settings.largest_bytes}" if known_bytes is None else f"the list says {known_bytes}"
        raise TransferError("wrong-length", f"{source} has {size} bytes, {wanted}", passing=False)
    with source.open("rb") as there, part.path.open("wb") as here:
        shutil.copyfileobj(there, here, BLOCK_BYTES)
