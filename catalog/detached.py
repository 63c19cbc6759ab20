"""The file that belongs to an image: its detached label, or the image that a label describes."""

import re
from pathlib import Path

from catalog.absent import absent_file
from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.regular_file import is_folder, is_regular, open_regular

PDS4_SUFFIXES = (".xml", ".lblx")  # in any case
LABEL_SUFFIXES = (".LBL", ".lbl", ".Lbl", ".xml", ".XML", ".lblx")
PACKED_SUFFIXES = (".gz", ".bz2")
MAX_LABEL_BYTES = 2_000_000
MAX_FILES = 20_000
POINTERS = (
    re.compile(rb"<file_name>\s*([^<>\s][^<>]*?)\s*</file_name>"),
    re.compile(rb"(?m)^[ \t]*\^(?:IMAGE|QUBE|Core)\s*=\s*\(?\s*[\"']?([^\"'(),\s]+)"),
)
IS_LABEL = re.compile(rb"\s*(?:\xef\xbb\xbf)?(?:<\?xml|PDS_VERSION_ID|CCSD3ZF|Object\s*=\s*IsisCube)")


def label_beside(path: Path) -> Path | None:
    """The other file of an image: the label beside it (same name, .LBL, .lbl, .xml or .lblx), or, where `path` is a
    label, the file with the pixels that it names; None when there is none."""
    if known := absent_file(path):
        return known.other
    described = _described(path)
    if described is not None:
        return described
    for name in label_names(path):
        if is_regular(path.parent / name):
            return path.parent / name
    return None


def label_names(path: Path) -> list[str]:
    """Names that the label beside an image may have, the first that is there being it."""
    names = [path, *([path.with_suffix("")] if path.suffix.lower() in PACKED_SUFFIXES else [])]
    beside = [name.with_suffix(suffix) for name in names for suffix in LABEL_SUFFIXES]
    return [each.name for each in beside if each != path]


def data_beside(label: Path, name: str) -> Path:
    """The file of that name in the label's folder, upper and lower case being one where no other has the very name.

    Raises RefusedError when there is none; a name with a folder in it is never followed."""
    found = _in_folder(label, name)
    if found is None:
        raise RefusedError(
            Reason.IMAGE_MISSING,
            f"image {label}: the file {name} that its label names is not beside it.",
            "Put label and image into one folder, under the name that the label gives.",
        )
    return found


def packed_beside(label: Path) -> Path | None:
    """The packed file with the pixels of a label whose own file, under the name that the label gives, is not there."""
    name = name_described(label)
    if name is None or _in_folder(label, name) is not None:
        return None
    return next((found for end in PACKED_SUFFIXES if (found := _in_folder(label, name + end))), None)


def _in_folder(label: Path, name: str) -> Path | None:
    if not name or name.isdecimal() or name in (".", "..") or any(mark in name for mark in "/\\:\0"):
        return None
    exact = label.parent / name
    if is_regular(exact):
        return exact
    if not is_folder(label.parent):
        return None
    for number, path in enumerate(label.parent.iterdir()):
        if number >= MAX_FILES:
            return None
        if path.name.lower() == name.lower() and is_regular(path):
            return path
    return None


def _described(path: Path) -> Path | None:
    """The file that a label names for its image; None where `path` is no label, or holds the image itself."""
    name = name_described(path)
    found = None if name is None else _in_folder(path, name)
    return found if found != path else None


def name_described(path: Path) -> str | None:
    """The name that a label says its image has; None where `path` is no label."""
    try:
        with open_regular(path) as file:
            head = file.read(200)
            if not IS_LABEL.match(head):
                return None
            text = head + file.read(MAX_LABEL_BYTES)
    except OSError:
        return None
    matches = (pointer.search(text) for pointer in POINTERS)
    return next((match.group(1).decode("latin-1") for match in matches if match), None)
