"""The tables of marks that an undistortion reads are part of its key."""

from pathlib import Path

import pytest

import catalog.reseau
from catalog.camera import known_cameras
from flows.inputs import reseau_digests
from tasks.undistort import UndistortSettings


def digests(camera: str, **settings: str) -> dict[str, str]:
    return reseau_digests(known_cameras()[camera], UndistortSettings.model_validate(settings))


def test_a_changed_table_changes_the_key_of_its_camera_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for path in catalog.reseau.RESEAU_FOLDER.glob("*.tsv"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.setattr(catalog.reseau, "RESEAU_FOLDER", tmp_path)
    first, second = digests("voyager1-nac"), digests("voyager2-nac")
    assert list(first) == ["vg1_na_sn7"]
    table = tmp_path / "vg1_na_sn7.tsv"
    table.write_text(table.read_text() + "# touched\n")
    assert digests("voyager1-nac") != first
    assert digests("voyager2-nac") == second


def test_a_users_table_counts_by_its_content(tmp_path: Path) -> None:
    own = tmp_path / "own.tsv"
    own.write_text("one")
    first = digests("voyager1-nac", marks=str(own))
    own.write_text("other")
    assert len(first) == 2
    assert digests("voyager1-nac", marks=str(own)) != first


def test_cameras_without_marks_and_settings_without_a_table_have_none() -> None:
    assert digests("galileo-ssi") == {}
    assert list(digests("voyager1-nac", marks="nominal")) == ["vg1_na_sn7"]
