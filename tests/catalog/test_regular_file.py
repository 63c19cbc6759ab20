"""Whatever is named in place of a file: nothing is waited for, and the reason names it."""

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catalog.basemap import read_map
from catalog.camera import read_camera_file
from catalog.digest import refuse_changed, sha256_of_file
from catalog.errors import RefusedError
from catalog.input_file import digest_of
from catalog.lists import load_image_list
from catalog.lists.pds_index import read_index_label
from catalog.lists.scan import scan_folder
from catalog.mask import read_mask
from catalog.plain_text import is_text, printable
from catalog.pose import read_pose_file
from catalog.readers import read_frame
from catalog.regular_file import ChangedError, NotRegularError, TooLargeError, open_regular, read_regular
from catalog.reseau import read_reseau_table
from catalog.spice import kernel_pool, refuse_what_holds_no_kernel
from catalog.target import find_target
from tasks.export.pixels import Selection
from tasks.photometry.regions import read_regions
from tasks.profile import read_profile
from tasks.project.mesh import read_mesh


def a_socket(path: Path) -> None:
    here = os.getcwd()
    os.chdir(path.parent)
    try:
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind(path.name)
    finally:
        os.chdir(here)


def a_link_to_zero(path: Path) -> None:
    path.symlink_to("/dev/zero")


THINGS = {"pipe": os.mkfifo, "socket": a_socket, "device": a_link_to_zero, "folder": Path.mkdir}


def furnish(path: Path) -> None:
    with kernel_pool([path]):
        pass


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "image": ("x.img", read_frame),
    "mask": ("x.png", read_mask),
    "map": ("x.png", read_map),
    "pose": ("x.json", read_pose_file),
    "camera": ("x.toml", read_camera_file),
    "profile": ("x.toml", read_profile),
    "csv list": ("x.csv", load_image_list),
    "toml list": ("x.toml", load_image_list),
    "parquet list": ("x.parquet", load_image_list),
    "index": ("x.lbl", read_index_label),
    "marks": ("x.tsv", read_reseau_table),
    "regions": ("x.csv", lambda path: read_regions(path, Selection())),
    "mesh": ("x.obj", read_mesh),
    "shape": ("x.bds", lambda path: find_target("europa").with_shape(path)),
    "kernel": ("x.bsp", furnish),
    "kernel of the command": ("x", lambda path: refuse_what_holds_no_kernel([path])),
    "digest": ("x", lambda path: digest_of(path, "pose file")),
}


@pytest.mark.parametrize("thing", THINGS)
@pytest.mark.parametrize("reader", READERS)
def test_every_reader_refuses_what_is_no_file_and_names_it(reader: str, thing: str, tmp_path: Path) -> None:
    name, read = READERS[reader]
    path = tmp_path / name
    THINGS[thing](path)
    if (reader, thing) == ("kernel", "folder"):  # one without kernels is refused by the command
        return
    with pytest.raises(RefusedError) as refusal:
        read(path)
    assert name in refusal.value.fault
    assert refusal.value.remedy


def test_pipes_beside_images_are_passed_over(tmp_path: Path) -> None:
    for name in ("a.img", "a.LBL", "b.IMG"):
        os.mkfifo(tmp_path / name)
    found = scan_folder(tmp_path, tmp_path)
    assert (found.rows, found.passed_over) == ([], 3)


def test_no_more_is_read_of_a_growing_file_than_was_there(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(b"first")
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        path.write_bytes(b"first and second")
        assert file.read(size) == b"first"
    with pytest.raises(TooLargeError, match="16 bytes"):
        read_regular(path, 15)


def test_a_file_that_changes_while_it_is_hashed_has_no_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x"
    path.write_bytes(b"first")
    monkeypatch.setattr("catalog.digest._digest", lambda *_: path.write_bytes(b"longer than the first"))
    with pytest.raises(ChangedError):
        sha256_of_file(path)
    monkeypatch.undo()
    digest = sha256_of_file(path)
    refuse_changed(path, digest, "file")
    path.unlink()
    with pytest.raises(RefusedError, match="changed while it was read") as refusal:
        refuse_changed(path, digest, "file")
    assert str(path) in refusal.value.fault


def test_a_huge_hole_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "x.img"
    with path.open("wb") as file:
        file.truncate(10**13)
    for what in ("image", "mask", "pose file", "base map"):
        with pytest.raises(RefusedError, match="10000000000000 bytes"):
            digest_of(path, what)


def test_a_pipe_that_takes_a_file_s_place_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x"
    os.mkfifo(path)
    monkeypatch.setattr("catalog.regular_file.check_regular", lambda *_: None)
    with pytest.raises(NotRegularError, match="pipe"), open_regular(path):
        pass


@given(st.text(), st.binary(max_size=20))
def test_what_is_reported_is_one_printable_line(text: str, name: bytes) -> None:
    for given_text in (text, os.fsdecode(name)):
        error = RefusedError("code", f"image {given_text}", given_text)
        assert error.reason.isprintable()
        error.reason.encode()
        assert printable(printable(given_text)) == printable(given_text)
    assert is_text(os.fsdecode(name)) == _is_utf8(name)


def _is_utf8(name: bytes) -> bool:
    try:
        name.decode()
    except UnicodeDecodeError:
        return False
    return True
