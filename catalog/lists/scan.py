"""Rows of an image list from a folder of images: every file that a reader recognises, with what its label says."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from catalog.errors import RefusedError
from catalog.lists.location import ARCHIVE, URL
from catalog.lists.tables import Row
from catalog.packed import head_of
from catalog.reasons import Reason
from catalog.regular_file import NotRegularError, is_regular
from catalog.safe_name import safe_product_name
from catalog.times import utc_from_et

LABEL_SUFFIXES = (".LBL", ".lbl")


@dataclass
class Scan:
    """rows: of the readable images. faults: of the others. passed_over: labels, tables and other files."""

    rows: list[Row] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    passed_over: int = 0


def scan_folder(folder: Path, relative_to: Path) -> Scan:
    """Read every image below `folder`, in the order of names; links to folders and hidden files are left out. Paths of
    the rows are relative to `relative_to` where they lie below it. Raises RefusedError when it is no folder."""
    if not folder.is_dir():
        raise RefusedError(
            Reason.FOLDER_MISSING, f"{folder} is no folder.", "Give a folder of images, or an index label."
        )
    found = Scan()
    for path in _files(folder):
        if not looks_like_an_image(path):
            found.passed_over += 1
            continue
        try:
            found.rows.append(row_of_file(path, relative_to))
        except RefusedError as refusal:
            found.faults.append(refusal.reason)
    return found


def _files(folder: Path) -> Iterator[Path]:
    for parent, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        yield from (Path(parent) / name for name in sorted(names) if not name.startswith("."))


def looks_like_an_image(path: Path) -> bool:
    """Whether a reader recognises the first bytes of a regular file, or of what is packed in it."""
    from catalog.readers import all_readers
    from catalog.readers.reading import HEAD_BYTES

    try:
        head = head_of(path, HEAD_BYTES)
    except (IsADirectoryError, NotRegularError):
        return False
    return any(reader.recognises(head, path) for reader in all_readers())


def row_of_file(path: Path, relative_to: Path) -> Row:
    """What is known of one image; not checked yet. Raises RefusedError as `read_frame` does."""
    from catalog.readers import read_frame

    frame = read_frame(path)
    beside = (path.with_suffix(suffix) for suffix in LABEL_SUFFIXES if path.suffix != suffix)
    label = next((candidate for candidate in beside if is_regular(candidate)), None)
    found = {
        "product": safe_product_name(path.stem),
        "image": _relative(path, relative_to),
        "label": None if label is None else _relative(label, relative_to),
        "camera": frame.camera,
        "target": frame.target,
        "utc": None if frame.et is None else utc_from_et(frame.et),
        "exposure_s": frame.exposure_s if frame.exposure_s is None or frame.exposure_s >= 0 else None,
        "filter": frame.filter,
        "sha256": frame.sha256,
        "bytes": path.stat().st_size,
    }
    return {key: value for key, value in found.items() if value is not None}


def _relative(path: Path, start: Path) -> str:
    whole, base = path.resolve(), start.resolve()
    text = str(whole.relative_to(base) if whole.is_relative_to(base) else whole)
    return f"./{text}" if ARCHIVE.match(text) or URL.match(text) else text  # a folder may be called like an archive
