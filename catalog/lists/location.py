"""Where a file is: a path, a URL, or a place in an archive whose address `archives.toml` knows."""

import re
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, urlsplit

from catalog.settings import archive_folder

ARCHIVES_FILE = Path(__file__).parent / "archives.toml"
ARCHIVE = re.compile(r"^([a-z][a-z0-9-]+):(?!//)(.+)$")
URL = re.compile(r"^(https?|s3)://", re.IGNORECASE)
# An address as a path has it, in which two slashes are one.
ADDRESS = re.compile(r"^(https?|s3):/{1,2}(?=[^/])", re.IGNORECASE)
S3 = "s3"
HOST = re.compile(r"^[A-Za-z0-9.-]+(:\d{1,5})?$")
PLAIN_PART = re.compile(r"^[\w.+=,@() -]{1,200}$")


@dataclass(frozen=True)
class Archive:
    """A place that files are fetched from: url has the address that relative paths are appended to."""

    name: str
    url: str
    title: str = ""
    source: str = ""


@cache
def known_archives() -> dict[str, Archive]:
    """The archives of `archives.toml` by name."""
    content = tomllib.loads(ARCHIVES_FILE.read_text())
    return {name: Archive(name=name, **fields) for name, fields in content.items()}


@dataclass(frozen=True)
class Location:
    """A parsed location. archive: name, None for a path or a URL. url: None for a path. path: as given, or the
    relative path in the archive or on the host."""

    path: str
    url: str | None = None
    archive: str | None = None

    def url_at(self, mirror: str | None = None) -> str | None:
        """Its URL; with a mirror, that address followed by archive or host and path."""
        if self.url is None or mirror is None:
            return self.url
        return f"{mirror.rstrip('/')}/{self.path}"

    def local_path(self, folder: Path, archive: Path | None = None) -> Path:
        """The file on this machine: a path relative to `folder`, anything else below `archive`, which it cannot
        leave."""
        if self.url is None:
            return folder / Path(self.path).expanduser()
        return (archive or archive_folder()) / self.path


def parse_location(text: str) -> Location:
    """The location that `text` means. Raises ValueError for an unknown archive, a URL that is none, `..` in either, or
    characters that no archive uses."""
    if not text.strip() or "\0" in text:
        raise ValueError(f"{text!r} is no path")
    if URL.match(text):
        return _of_url(text)
    match = ARCHIVE.match(text)
    if match is None:
        return Location(text)
    name, path = match.groups()
    if name not in known_archives():
        raise ValueError(f"archive {name!r} of {text!r} is unknown; known: {', '.join(known_archives())}")
    relative = _plain_path(path, text)
    return Location(f"{name}/{relative}", known_archives()[name].url.rstrip("/") + f"/{relative}", name)


def address_in(path: Path | str) -> str | None:
    """The address (http, https or s3) that a path stands for, or a text is; None for a path of this machine."""
    text = str(path)
    match = ADDRESS.match(text)
    return f"{match[1].lower()}://{text[match.end() :]}" if match else None


def address_beside(address: str, name: str) -> str:
    """Address of the file `name` in the folder of another address."""
    return f"{address.rpartition('/')[0]}/{name}"


def _of_url(text: str) -> Location:
    parts = urlsplit(text)
    if not HOST.match(parts.netloc) or parts.query or parts.fragment:
        raise ValueError(f"{text!r} is no URL of a file (host and path, neither user nor query)")
    host = re.sub(r"[^\w.-]", "_", parts.netloc.lower())
    if parts.scheme.lower() == S3:
        host = f"{S3}/{host}"
    return Location(f"{host}/{_plain_path(unquote(parts.path).lstrip('/'), text)}", text)


def _plain_path(path: str, text: str) -> str:
    parts = PurePosixPath(path).parts
    if not parts or path.endswith("/") or not all(PLAIN_PART.match(part) and part.strip(". ") for part in parts):
        raise ValueError(f"{text!r} is no path of a file inside its archive")
    return "/".join(parts)
