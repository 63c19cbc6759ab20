"""GEOMA and RESLOC tables of the PDS Ring Node."""

from pathlib import Path

import numpy as np
import pytest
import vax

from catalog.camera import known_cameras
from catalog.errors import RefusedError
from catalog.reseau import find_reseau_table
from catalog.reseau.archive import is_archive_table, read_archive_marks, read_tiepoints
from tasks.undistort import UndistortSettings
from tasks.undistort.choose import chosen_model

TABLE = find_reseau_table("vg1_wa_sn6")
SHIFT = np.array([1.25, -2.5])
# The first rows of C3490702_GEOMA.TAB (PDS Ring Node, VGISS_6117), which ships with rms-vax 1.0.1.
REAL_ROWS = "  1, 25.36, 25.31,  9.8317, 15.8628\r\n  3, 20.53, 85.59,  2.6002, 60.8629\r\n"


def one_based(xy: np.ndarray) -> np.ndarray:
    return xy[:, ::-1] + 1.0


def geoma_rows() -> np.ndarray:
    """Each mark twice, as VICAR has them, and a node between marks."""
    nodes = np.hstack([one_based(TABLE.object_xy), one_based(TABLE.raw_xy + SHIFT)])
    return np.repeat(np.vstack([nodes, [[300.5, 300.5, 250.25, 250.25]]]), 2, axis=0)


def write_geoma_dat(path: Path) -> None:
    rows = geoma_rows()
    label = f"LBLSIZE=1024   FORMAT='BYTE'  TYPE='TABULAR'  NS=512  NR={len(rows)}  NC=4  ORG='ROW'".ljust(1024, "\0")
    path.write_bytes(label.encode() + vax.to_vax32_bytes(rows.astype(np.float32).ravel()) + b"\0" * 512)


def write_reslc_dat(path: Path) -> None:
    values = one_based(TABLE.raw_xy + SHIFT).astype(np.float32).ravel()
    label = f"LBLSIZE=512  TYPE='TABULAR'  NR=1  NC={5 + len(values)}  ORG='ROW'".ljust(512, "\0")
    integers = np.array([3490702, 6, 1, 80, 316], "<i4").tobytes()
    path.write_bytes(label.encode() + integers + vax.to_vax32_bytes(values))


def write_geoma_tab(path: Path) -> None:
    lines = (f"{n:3d}," + ",".join(f"{value:8.4f}" for value in row) for n, row in enumerate(geoma_rows(), 1))
    path.write_text("\r\n".join(lines) + "\r\n")


def write_resloc_tab(path: Path) -> None:
    rows = one_based(TABLE.raw_xy + SHIFT)
    path.write_text("".join(f"{n:3d},{line:9.4f},{sample:9.4f}\r\n" for n, (line, sample) in enumerate(rows, 1)))


WRITERS = {
    "C1_GEOMA.DAT": write_geoma_dat,
    "C1_GEOMA.TAB": write_geoma_tab,
    "C1_RESLOC.DAT": write_reslc_dat,
    "C1_RESLOC.TAB": write_resloc_tab,
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_kind_of_table_gives_the_marks_of_the_image(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    WRITERS[name](path)
    assert is_archive_table(path)
    marks = read_archive_marks(path, TABLE)
    assert np.abs(marks.raw_xy - TABLE.raw_xy - SHIFT).max() < 1e-3
    assert np.array_equal(marks.object_xy, TABLE.object_xy)


def test_rows_of_a_real_table_become_zero_based_x_and_y(tmp_path: Path) -> None:
    path = tmp_path / "C3490702_GEOMA.TAB"
    path.write_text(REAL_ROWS)
    object_xy, raw_xy = read_tiepoints(path)
    assert np.allclose(object_xy, [[24.31, 24.36], [84.59, 19.53]])
    assert np.allclose(raw_xy, [[14.8628, 8.8317], [59.8629, 1.6002]])


def test_a_camera_can_be_undistorted_with_the_archives_table(tmp_path: Path) -> None:
    path = tmp_path / "C1_GEOMA.DAT"
    write_geoma_dat(path)
    settings = UndistortSettings(method="delaunay", marks=str(path))
    model, evidence = chosen_model(known_cameras()["voyager1-wac"], settings)
    assert np.abs(model.distort_points(TABLE.object_xy) - TABLE.raw_xy - SHIFT).max() < 1e-3
    assert evidence["marks"] == str(path)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "coordinates"),
        (b"one,two,three\r\n", "numbers"),
        (b"1,2\r\n", "coordinates"),
        (b"\xff\xfe\x00", "numbers"),
        (b"1,nan,5,6,7\r\n", "lines and samples"),
        (b"LBLSIZE=100  NR=552  NC=4  " + b" " * 80, "promises"),
        (b"LBLSIZE=100  NC=4  " + b" " * 90, "NR"),
        (REAL_ROWS.encode(), "vg1_wa_sn6"),
    ],
)
def test_broken_tables_are_refused_by_name(tmp_path: Path, content: bytes, word: str) -> None:
    path = tmp_path / "C9_GEOMA.DAT"
    path.write_bytes(content)
    with pytest.raises(RefusedError, match=word) as refusal:
        read_archive_marks(path, TABLE)
    assert "C9_GEOMA.DAT" in refusal.value.reason
    with pytest.raises(RefusedError, match="cannot be read"):
        read_archive_marks(tmp_path / "C8_GEOMA.DAT", TABLE)
