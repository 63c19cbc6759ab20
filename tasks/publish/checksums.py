"""SHA256SUMS: the digest of every file of a product, recorded when it is published; `sha256sum -c` reads it too."""

import os
from pathlib import Path

from catalog.digest import sha256_of_file
from tasks.atomic import file_put_in_place
from tasks.record import RECORD_FILE

CHECKSUMS = "SHA256SUMS"
NOT_COVERED = (CHECKSUMS, RECORD_FILE)  # the record is written after the product, and carries its own key


def write_checksums(folder: Path) -> Path:
    """Write the digests of all files below `folder`, by relative path, and return the list's path."""
    lines = [f"{sha256_of_file(folder / name)}  {name}\n" for name in _files(folder)]
    (folder / CHECKSUMS).write_text("".join(lines), encoding="utf-8")
    return folder / CHECKSUMS


def read_checksums(folder: Path) -> dict[str, str]:
    """Digests by relative path. Raises OSError when there is no list, ValueError when a line is none."""
    digests = {}
    for line in (folder / CHECKSUMS).read_text(encoding="utf-8").splitlines():
        digest, separator, name = line.partition("  ")
        if not separator or len(digest) != 64 or not name:
            raise ValueError(f"{CHECKSUMS} has a line that is no checksum: {line[:80]!r}")
        digests[name] = digest
    return digests


def missing_files(folder: Path) -> list[str]:
    """Files of a product that its list of checksums names and that are not there; none without a readable list."""
    try:
        recorded = read_checksums(folder)
    except (OSError, ValueError):
        return []
    return [name for name in recorded if not os.path.isfile(os.path.join(folder, name))]


def refresh_checksum(folder: Path, name: str) -> None:
    """Record a file's new digest, in a product that has checksums."""
    if (folder / CHECKSUMS).is_file():
        digests = {**read_checksums(folder), name: sha256_of_file(folder / name)}
        text = "".join(f"{digest}  {path}\n" for path, digest in sorted(digests.items()))
        with file_put_in_place(folder / CHECKSUMS) as temporary:
            temporary.write_text(text, encoding="utf-8")


def checksum_faults(folder: Path) -> list[str]:
    """Every file of a product that is missing, has changed, or was not there at publication."""
    try:
        recorded = read_checksums(folder)
    except FileNotFoundError:
        return [f"{CHECKSUMS} is missing: an older version published this, or somebody deleted it"]
    except (OSError, ValueError) as error:
        return [f"{CHECKSUMS} cannot be read: {error}"]
    present = _files(folder)
    faults = [f"{name} is missing" for name in recorded if name not in present]
    faults += [f"{name} is not among the files that were published" for name in present if name not in recorded]
    changed = [name for name in present if name in recorded and sha256_of_file(folder / name) != recorded[name]]
    return faults + [f"{name} has changed since publication" for name in changed]


def _files(folder: Path) -> list[str]:
    """Relative paths of the files that a list of checksums covers, in order."""
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return [name for name in names if name not in NOT_COVERED]
