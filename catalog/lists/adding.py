"""Add to an image list what a folder or a PDS3 index holds, and check a list against the files it names."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from catalog.basemap import NO_MAP
from catalog.camera import find_camera
from catalog.digest import sha256_of_file
from catalog.errors import RefusedError
from catalog.lists.kernel_sets import expanded
from catalog.lists.loading import load_image_list, read_image_list, sound_entries, write_image_list
from catalog.lists.location import parse_location
from catalog.lists.model import ImageEntry, ImageList
from catalog.lists.pds_index import index_entries
from catalog.lists.scan import scan_folder
from catalog.lists.tables import Row
from catalog.pose import IN_IMAGE
from catalog.target import find_target, is_target_file

# Words that stand where a file's path may.
IN_PLACE_OF_FILES = {("base map", NO_MAP), ("pose file", IN_IMAGE)}


@dataclass(frozen=True)
class Wanted:
    """Which rows are added, and what is said of all of them. base: see `index_entries`."""

    target: str | None = None
    camera: str | None = None
    base: str | None = None
    kernels: tuple[str, ...] = ()


@dataclass(frozen=True)
class Added:
    """The list as written, how many entries came in, the faults of others, and how many files were no images."""

    image_list: ImageList
    count: int
    faults: tuple[str, ...]
    passed_over: int


def add_to_list(sources: list[Path], list_file: Path, wanted: Wanted | None = None) -> Added:
    """Add the images of folders and of index labels to a list file, which may be new; what repeats a product, a file or
    a content is refused. Raises RefusedError when a source or the list cannot be used; the list is unchanged then."""
    wanted = wanted or Wanted()
    old = load_image_list(list_file) if list_file.exists() else ImageList(name=list_file.stem, file=list_file)
    faults: list[str] = []
    passed_over = 0
    rows: list[tuple[str, Row]] = []
    for source in sources:
        if source.is_dir():
            found = scan_folder(source, list_file.parent)
            rows += [(row["image"], row) for row in found.rows if _is_wanted(row, wanted)]
            faults += found.faults
            passed_over += found.passed_over
        else:
            rows += index_entries(source, wanted.base, wanted.target, wanted.camera)
    if wanted.kernels:
        rows = [(place, row | {"kernels": list(wanted.kernels)}) for place, row in rows]
    entries, refused = sound_entries(rows, old.entries)
    new = old.model_copy(update={"entries": (*old.entries, *entries), "file": list_file})
    if entries or not list_file.exists():
        write_image_list(new, list_file)
    return Added(new, len(entries), (*faults, *refused), passed_over)


def _is_wanted(row: Row, wanted: Wanted) -> bool:
    return wanted.target in (None, row.get("target")) and wanted.camera in (None, row.get("camera"))


@dataclass(frozen=True)
class Checked:
    """The sound part of a list, every fault, and the locations of archives that have not been fetched yet."""

    image_list: ImageList
    faults: tuple[str, ...]
    not_fetched: tuple[str, ...]


def check_list(list_file: Path, archive: Path | None = None) -> Checked:
    """Check rows, and the files that are on this machine: whether they are there, whether their content is what the
    list says, whether two products have the same one. archive: where fetched files are."""
    found, faults = read_image_list(list_file)
    not_fetched: dict[str, None] = {}
    for fault, location in _faults_of_files(found, archive):
        if location is not None:
            not_fetched[location] = None
        elif fault not in faults:
            faults.append(fault)
    return Checked(found, tuple(faults), tuple(not_fetched))


def _faults_of_files(image_list: ImageList, archive: Path | None) -> Iterator[tuple[str, str | None]]:
    first: dict[str, str] = {}
    for entry in image_list.entries:
        yield from faults_of_entry(image_list, entry, archive)
        path = image_list.located(entry.image, archive)
        if path.is_file():
            digest = sha256_of_file(path)
            if digest in first:
                yield f"{entry.product}: its image has the same content as {first[digest]}'s", None
            first.setdefault(digest, entry.product)


def faults_of_entry(
    image_list: ImageList, entry: ImageEntry, archive: Path | None = None
) -> Iterator[tuple[str, str | None]]:
    """What is wrong with the files of one entry, in words; with the location of a file that can still be fetched."""
    named = {"image": entry.image, "label": entry.label, "pose file": entry.pose_file, "truth": entry.truth_file}
    named |= {"base map": entry.basemap} | {f"kernel {text}": text for text in expanded(entry.kernels)}
    expected = {"image": entry.sha256, "label": entry.label_sha256}
    for what, text in named.items():
        if text is None or (what, text) in IN_PLACE_OF_FILES:
            continue
        path = image_list.located(text, archive)
        if not path.exists():
            remote = text if parse_location(text).url else None
            yield f"{entry.product}: its {what} {path} is not there", remote
        elif expected.get(what) and sha256_of_file(path) != expected[what]:
            yield f"{entry.product}: the content of its {what} {path} is not what the list says", None
    if entry.camera and entry.camera.endswith(".toml"):
        yield from _fault_of(find_camera, image_list.folder / entry.camera)
    if entry.target and is_target_file(entry.target):
        yield from _fault_of(find_target, image_list.folder / entry.target)


def _fault_of(find: Callable[[str], object], path: Path) -> Iterator[tuple[str, None]]:
    try:
        find(str(path))
    except RefusedError as refusal:
        yield refusal.fault, None
