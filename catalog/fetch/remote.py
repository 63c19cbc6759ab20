"""Single files at addresses (http, https, s3), had in the folder of fetched files as they are there now.

What was fetched before is taken while its version (ETag, or Last-Modified and length) is the same; beside it a small
file keeps version and content. The label beside an image comes with it.
"""

import hashlib
import json
import os
import time
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from catalog.detached import label_names, name_described
from catalog.digest import sha256_of_file
from catalog.errors import FailedError
from catalog.fetch.item import fetch_item
from catalog.fetch.ledger import Ledger
from catalog.fetch.plan import item_of
from catalog.fetch.rate import RateLimit
from catalog.fetch.settings import FetchSettings, default_mirror
from catalog.fetch.transfer import TransferError
from catalog.fetch.versions import names_at, version_of
from catalog.lists.location import address_beside, parse_location
from catalog.reasons import Reason

NOTES = ".remote"
BUSY, MISSING = "busy", "http-404"
WAIT_S, PATIENCE_S = 0.2, 600.0
# Choice: how long a file that many images share is taken to be the same without a look, the work of some images.
SHARED_S = 120.0
_rate = RateLimit(FetchSettings().requests_per_s)
_looked_at: dict[tuple[str, Path], float] = {}


class RemoteImage(BaseModel):
    """An image as it was had. version: of the file and its label together. sha256: of its content. label: name of the
    other file beside it. label_sha256: of that."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    version: str
    sha256: str
    label: str | None = None
    label_sha256: str | None = None


def have_shared(address: str, archive: Path) -> Path:
    """`have` of a file that many images share: looked at once in SHARED_S."""
    key, now = (address, archive), time.monotonic()
    path = archive / parse_location(address).path
    if now - _looked_at.get(key, -SHARED_S) >= SHARED_S or not path.is_file():
        have(address, archive)
        _looked_at[key] = now
    return path


def have_image(address: str, archive: Path, sha256: str | None = None) -> RemoteImage:
    """Have an image and the other file of it: the label beside it, or the file that it names when it is a label itself.
    sha256: of its content, where that is known. Raises FailedError when one of them cannot be had."""
    path = archive / parse_location(address).path
    version = have(address, archive, sha256)
    name = other_name(address, path)
    other = f" {name} {have(address_beside(address, name), archive)}" if name else ""
    beside = path.parent / name if name else None
    found = RemoteImage(
        version=version + other,
        sha256=sha256_of_file(path),
        label=name,
        label_sha256=sha256_of_file(beside) if beside else None,
    )
    _write(_note_of(path, archive), found.model_dump(mode="json"))
    return found


def image_had(address: str, archive: Path) -> RemoteImage | None:
    """What `have_image` had the last time; None when it did not."""
    try:
        content = json.loads(_note_of(archive / parse_location(address).path, archive).read_text(encoding="utf-8"))
        return RemoteImage.model_validate(content)
    except (OSError, ValueError):
        return None


def version_now(address: str, known: RemoteImage) -> str:
    """Version that image and label have now, to be compared with the known one. Raises FailedError when nobody says."""
    try:
        found = version_of(item_of(address, default_mirror()).source)
        names = names_at(item_of(address, default_mirror()).source, label_names(Path(address)))
        label = known.label if known.label not in label_names(Path(address)) else next(iter(names), None)
        other = version_of(item_of(address_beside(address, label), default_mirror()).source) if label else ""
    except TransferError as error:
        raise _failure(address, str(error)) from _cause(error)
    return f"{found} {label} {other}" if label else found


def other_name(address: str, path: Path) -> str | None:
    """Name of the other file of the image that was had at `path`; a label that was there before and is not any more is
    deleted."""
    described = name_described(path)
    if described is not None and described != path.name and not set(described) & set("/\\:\0"):
        return described
    wanted = label_names(path)
    source = item_of(address, default_mirror()).source
    try:
        there = names_at(source, wanted)
    except TransferError as error:
        raise _failure(address, str(error)) from _cause(error)
    for name in set(wanted) - set(there):
        (path.parent / name).unlink(missing_ok=True)
    return there[0] if there else None


def have(address: str, archive: Path, sha256: str | None = None) -> str:
    """Have the file at an address; the version that it is of. Raises FailedError when it cannot be had."""
    item = item_of(address, default_mirror())
    path, note = archive / item.path, _note_of(archive / item.path, archive, "file")
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            version = version_of(item.source)
        except TransferError as error:
            raise _failure(address, str(error)) from _cause(error)
        if path.is_file() and _read(note) == {"version": version, "source": item.source, "mtime": path.stat().st_mtime}:
            return version
        known = Ledger(note.parent)
        outcome = fetch_item(item.with_sha256(sha256), archive, FetchSettings(), _rate, known, renew=True)
        reason = outcome.reason or ""
        if outcome.status != "failed":
            _write(note, {"version": version, "source": item.source, "mtime": path.stat().st_mtime})
            return version
        if not reason.startswith(BUSY) or time.monotonic() > deadline:
            fault = TransferError("transfer", reason, outcome.passing or reason.startswith(BUSY))
            raise _failure(address, reason) from _cause(fault)
        time.sleep(WAIT_S)  # another process of this machine fetches it


def _failure(address: str, reason: str) -> FailedError:
    remedy = "Check the address." if MISSING in reason else "Run it again (it goes on where it stopped)."
    return FailedError(Reason.NOT_FETCHED, f"{address}: {reason}.", remedy)


def _cause(error: TransferError) -> Exception:
    """What says of a failure whether it can pass."""
    return ConnectionError(str(error)) if error.passing else error


def _note_of(path: Path, archive: Path, what: str = "image") -> Path:
    name = hashlib.sha256(str(path.relative_to(archive)).encode()).hexdigest()[:32]
    return archive / NOTES / name[:2] / f"{name}.{what}.json"


def _read(note: Path) -> Any:
    try:
        return json.loads(note.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def _write(note: Path, content: Any) -> None:
    note.parent.mkdir(parents=True, exist_ok=True)
    temporary = note.with_name(f".{note.name}.{os.getpid()}")
    temporary.write_text(json.dumps(content), encoding="utf-8")
    os.replace(temporary, note)
