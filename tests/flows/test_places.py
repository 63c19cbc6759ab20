"""A store that cannot be one is refused before any work, whatever is wrong with its name."""

from collections.abc import Callable
from pathlib import Path

import pytest

from catalog.errors import RefusedError
from tasks.objectstore.places import usable_place_of


def dangling(folder: Path) -> Path:
    (folder / "link").symlink_to(folder / "nowhere")
    return folder / "link"


def endless(folder: Path) -> Path:
    (folder / "loop").symlink_to("loop")
    return folder / "loop"


def a_file(folder: Path) -> Path:
    (folder / "file").touch()
    return folder / "file"


UNUSABLE: dict[str, Callable[[Path], Path]] = {
    "File name too long": lambda folder: folder / ("x" * 300),
    "name too long": lambda folder: folder / ("x" * 300) / "below",
    "null": lambda folder: folder / "a\0b",
    "is a link to what is not there": dangling,
    "on its way is a link to what is not there": lambda folder: dangling(folder) / "below",
    "symbolic links": endless,
    "is a file": a_file,
    "on its way is a file": lambda folder: a_file(folder) / "below",
}


@pytest.mark.parametrize(("reported", "store_in"), UNUSABLE.items(), ids=UNUSABLE.keys())
def test_a_store_that_cannot_be_one_is_refused_by_name(
    reported: str, store_in: Callable[[Path], Path], tmp_path: Path
) -> None:
    with pytest.raises(RefusedError, match=f"^store {tmp_path}.*{reported}.* Give a folder"):
        usable_place_of(store_in(tmp_path))


def test_links_to_folders_and_folders_yet_to_be_made_are_stores(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    for store in (tmp_path / "link", tmp_path / "link" / "new" / "newer", tmp_path / "ä 日本"):
        assert usable_place_of(store).store == store
