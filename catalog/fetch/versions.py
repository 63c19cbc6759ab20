"""Which version of a file is at an address, and which files are beside it; nothing is transferred."""

import os
from pathlib import Path
from typing import Any

from catalog.fetch.settings import FetchSettings
from catalog.fetch.signed import files_of, storage_errors
from catalog.fetch.transfer import PASSING_STATUS, TransferError
from catalog.lists.location import S3, address_beside

NO_HEAD = (405, 501)


def version_of(source: str) -> str:
    """ETag, or Last-Modified and length, of what is there; "unknown" where the server says neither. Raises
    TransferError when it is not there, or nobody answers."""
    if source.startswith(f"{S3}:"):
        facts = _s3_facts(source)
        return f"{facts.get('ETag')} {facts.get('size')}"
    if not source.startswith(("http:", "https:")):
        return _version_in_folder(Path(source))
    answer = _head(source)
    if answer.status_code in NO_HEAD:
        return "unknown"
    if answer.status_code != 200:
        raise TransferError(
            f"http-{answer.status_code}",
            f"the server says {answer.status_code} {answer.reason}",
            answer.status_code in PASSING_STATUS,
        )
    stated = [answer.headers.get(name) for name in ("ETag", "Last-Modified", "Content-Length")]
    return " ".join(each for each in stated if each) or "unknown"


def names_at(source: str, names: list[str]) -> list[str]:
    """Those of `names` that are beside a file, in their order; over http the first one alone. Raises TransferError when
    nobody answers."""
    if source.startswith(f"{S3}:"):
        return _s3_names(source, names)
    found = []
    for name in names:
        try:
            version_of(address_beside(source, name))
        except TransferError as error:
            if error.passing:
                raise
            continue
        found.append(name)
        break
    return found


def _s3_facts(source: str) -> dict[str, Any]:
    files, path = files_of(source)
    try:
        return dict(files.info(path))
    except FileNotFoundError as error:
        raise TransferError("http-404", "the bucket has no such file", passing=False) from error
    except PermissionError as error:
        raise TransferError("http-403", f"it may not be read ({error})", passing=False) from error
    except storage_errors() as error:
        raise _unreachable(error) from error


def _s3_names(source: str, names: list[str]) -> list[str]:
    files, path = files_of(source)
    folder, _, name = path.rpartition("/")
    try:
        there = {found.rpartition("/")[2] for found in files.find(folder, prefix=Path(name).stem, maxdepth=None)}
    except FileNotFoundError:
        return []
    except PermissionError:  # the bucket lets nobody list it
        return [each for each in names if files.exists(f"{folder}/{each}")]
    except storage_errors() as error:
        raise _unreachable(error) from error
    return [each for each in names if each in there]


def _unreachable(error: Exception) -> TransferError:
    return TransferError("connection", f"the storage cannot be reached ({type(error).__name__}: {error})", passing=True)


def _head(source: str) -> Any:
    import requests

    settings = FetchSettings()
    headers = {"User-Agent": settings.user_agent, "Accept-Encoding": "identity"}
    timeouts = (settings.connect_timeout_s, settings.stall_timeout_s)
    try:
        return requests.head(source, headers=headers, timeout=timeouts, allow_redirects=True)
    except (requests.ConnectionError, requests.Timeout) as error:
        raise TransferError("connection", f"the connection broke ({error})"[:200], passing=True) from error
    except requests.RequestException as error:
        raise TransferError("request", f"{source} cannot be requested ({error})"[:200], passing=False) from error


def _version_in_folder(path: Path) -> str:
    try:
        stat = os.stat(path)
    except OSError as error:
        raise TransferError("not-in-mirror", f"the mirror has no {path}", passing=False) from error
    return f"{stat.st_mtime_ns} {stat.st_size}"
