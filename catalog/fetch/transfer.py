"""One attempt to get one file: continued where the last one ended, bounded in size, time and silence.

What has arrived stays in a part file; it becomes the file only when its length is what the server announced.
"""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catalog.fetch.settings import FetchSettings

BLOCK_BYTES = 1 << 16
PASSING_STATUS = (408, 425, 429, 500, 502, 503, 504)
RANGE_NOT_SATISFIABLE = 416
PAGE_STARTS = (b"<!doctype html", b"<html")
PAGE_SUFFIXES = (".html", ".htm")


class TransferError(Exception):
    """A file was not got. passing: another attempt may succeed; wait_s: as the server says, or None."""

    def __init__(self, code: str, fault: str, passing: bool, wait_s: float | None = None) -> None:
        self.code, self.fault, self.passing, self.wait_s = code, fault, passing, wait_s
        super().__init__(f"{code}: {fault}")


@dataclass(frozen=True)
class Part:
    """What has arrived so far. path: its bytes; beside it, which version of the file they belong to. trusted: a
    checksum will be compared, so that a part of unknown version may be continued."""

    path: Path
    trusted: bool = False

    @property
    def size(self) -> int:
        """Bytes so far."""
        return self.path.stat().st_size if self.path.exists() else 0

    @property
    def _note(self) -> Path:
        return self.path.with_name(f"{self.path.name}.version")

    def version(self) -> str | None:
        """ETag or Last-Modified of the file that the bytes belong to."""
        try:
            found = json.loads(self._note.read_text()).get("version")
        except (OSError, ValueError, AttributeError):
            return None
        return found if isinstance(found, str) else None

    def remember(self, version: str | None) -> None:
        """Note the version of the file whose bytes follow."""
        self._note.write_text(json.dumps({"version": version}))

    def discard(self) -> None:
        """Begin anew."""
        self.path.unlink(missing_ok=True)
        self._note.unlink(missing_ok=True)


def transfer(url: str, part: Part, settings: FetchSettings, known_bytes: int | None = None) -> None:
    """Bring the part up to the whole file. Raises TransferError; what arrived stays for the next attempt, unless it
    cannot be continued."""
    headers = {"User-Agent": settings.user_agent, "Accept-Encoding": "identity"}
    version = part.version()
    if part.size and not (version or part.trusted):
        part.discard()
    if part.size:
        headers |= {"Range": f"bytes={part.size}-"} | ({"If-Range": version} if version else {})
    with _answer(url, headers, settings) as answer:
        if answer.status_code == RANGE_NOT_SATISFIABLE:
            part.discard()
            raise TransferError("range", "the server cannot continue the part that is here", passing=True)
        _check_status(answer, settings)
        total = _begin(answer, part, known_bytes)
        if total is not None and total > settings.largest_bytes:
            part.discard()
            raise TransferError("too-large", f"{total} bytes, allowed are {settings.largest_bytes}", passing=False)
        _receive(answer, part, settings)
    _check_length(part, total, known_bytes)


@contextmanager
def _answer(url: str, headers: dict[str, str], settings: FetchSettings) -> Iterator[Any]:
    import requests
    import urllib3

    timeouts = (settings.connect_timeout_s, settings.stall_timeout_s)
    try:
        with requests.get(url, headers=headers, stream=True, timeout=timeouts) as answer:
            if url.startswith("https:") and not answer.url.startswith("https:"):
                raise TransferError("redirect", f"{url} leads to the unprotected {answer.url}", passing=False)
            yield answer
    except (requests.Timeout, urllib3.exceptions.ReadTimeoutError) as error:
        raise TransferError("stalled", f"nothing came for {timeouts[1]:g} s", passing=True) from error
    except (requests.ConnectionError, urllib3.exceptions.HTTPError) as error:
        raise TransferError("connection", f"the connection broke ({_short(error)})", passing=True) from error
    except requests.RequestException as error:
        raise TransferError("request", f"{url} cannot be requested ({_short(error)})", passing=False) from error


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:200]


def _check_status(answer: Any, settings: FetchSettings) -> None:
    status = answer.status_code
    if status in (200, 206):
        if answer.headers.get("Content-Encoding", "identity") != "identity":
            raise TransferError("encoded", "the server sends the file encoded against the request", passing=False)
        return
    wait = answer.headers.get("Retry-After", "")
    wait_s = min(float(wait), settings.longest_wait_s) if wait.isdigit() else None
    raise TransferError(f"http-{status}", f"the server says {status} {answer.reason}", status in PASSING_STATUS, wait_s)


def _begin(answer: Any, part: Part, known_bytes: int | None) -> int | None:
    """Make the part ready for what follows; the whole file's length, None where the server does not say."""
    length = answer.headers.get("Content-Length", "")
    following = int(length) if length.isdigit() else None
    if answer.status_code == 206:
        unit, _, span = answer.headers.get("Content-Range", "").partition(" ")
        span, _, total = span.partition("/")
        if unit != "bytes" or span.partition("-")[0] != str(part.size):
            part.discard()
            raise TransferError("range", f"the server continues elsewhere ({span or 'unsaid'})", passing=True)
        return int(total) if total.isdigit() else following and part.size + following
    part.discard()
    part.remember(_strong_version(answer))
    chunked = answer.headers.get("Transfer-Encoding", "").lower() == "chunked"
    if following is None and known_bytes is None and not (chunked or part.trusted):
        raise TransferError("length-unknown", "the server does not say how long the file is, nor the list", False)
    return following


def _strong_version(answer: Any) -> str | None:
    tag = answer.headers.get("ETag")
    return tag if tag and not tag.startswith("W/") else answer.headers.get("Last-Modified")


def _receive(answer: Any, part: Part, settings: FetchSettings) -> None:
    started, before = time.monotonic(), part.size
    size = before
    with part.path.open("ab") as file:
        while block := answer.raw.read1(BLOCK_BYTES, decode_content=False):  # what is there, without waiting for more
            if size == 0:
                _check_no_page(block, answer)
            size += len(block)
            if size > settings.largest_bytes:
                raise TransferError("too-large", f"more than {settings.largest_bytes} bytes come", passing=False)
            file.write(block)
            elapsed = time.monotonic() - started
            if elapsed > settings.stall_timeout_s and size - before < settings.slowest_bytes_per_s * elapsed:
                raise TransferError("slow", f"{size - before} bytes in {elapsed:.0f} s", passing=True)


def _check_no_page(block: bytes, answer: Any) -> None:
    """Archives answer a wrong address with a page and status 200."""
    path = answer.url.partition("?")[0].lower()
    if block.lstrip()[:20].lower().startswith(PAGE_STARTS) and not path.endswith(PAGE_SUFFIXES):
        raise TransferError("page", "the server sends a web page instead of the file", passing=False)


def _check_length(part: Part, total: int | None, known_bytes: int | None) -> None:
    if known_bytes is not None and total is not None and total != known_bytes:
        part.discard()
        raise TransferError("wrong-length", f"the file has {total} bytes, the list says {known_bytes}", passing=False)
    wanted = known_bytes if total is None else total
    if wanted is not None and part.size < wanted:
        raise TransferError("truncated", f"{part.size} of {wanted} bytes came", passing=True)
    if wanted is not None and part.size > wanted:
        size = part.size
        part.discard()
        raise TransferError("wrong-length", f"{size} bytes came, {wanted} were announced", passing=True)
