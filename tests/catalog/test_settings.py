"""Folders that planetpose keeps things in: where they are, and what to do where they cannot be."""

from pathlib import Path

import pytest

from catalog.errors import RefusedError
from catalog.settings import archive_folder, cache_folder, state_folder, ways_out_of
from tasks.boundary import file_trouble

FOLDERS = {
    "PLANETPOSE_CACHE": (cache_folder, "XDG_CACHE_HOME"),
    "PLANETPOSE_STATE": (state_folder, "XDG_STATE_HOME"),
    "PLANETPOSE_ARCHIVE": (archive_folder, "XDG_DATA_HOME"),
}


@pytest.fixture(autouse=True)
def nothing_configured(monkeypatch: pytest.MonkeyPatch) -> None:
    for variable, (_, xdg) in FOLDERS.items():
        monkeypatch.delenv(variable, raising=False)
        monkeypatch.delenv(xdg, raising=False)


@pytest.mark.parametrize("variable", FOLDERS)
def test_a_user_without_a_home_is_reported_what_to_set(variable: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def nowhere() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", nowhere)
    folder, xdg = FOLDERS[variable]
    with pytest.raises(RefusedError, match="HOME is not set") as refusal:
        folder()
    assert variable in refusal.value.remedy
    assert ways_out_of(Path("/somewhere")) == []
    monkeypatch.setenv(xdg, "/elsewhere")
    assert folder().is_relative_to("/elsewhere")
    monkeypatch.setenv(variable, "/here")
    assert folder() == Path("/here")


@pytest.mark.parametrize("variable", FOLDERS)
def test_a_home_that_nothing_can_be_made_in_names_the_variable(
    variable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a file").touch()
    monkeypatch.setenv("HOME", str(tmp_path / "a file"))
    folder = FOLDERS[variable][0]()
    with pytest.raises(OSError, match="a file") as trouble:
        folder.mkdir(parents=True)
    reported = file_trouble(trouble.value)
    assert "Set PLANETPOSE_" in reported
    assert all(name in reported for name in FOLDERS)


@pytest.mark.parametrize("variable", FOLDERS)
def test_files_in_a_folder_of_ours_name_its_variable_and_others_do_not(
    variable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    own = FOLDERS[variable][0]()
    assert ways_out_of(own / "x" / "y") == [variable]
    assert ways_out_of(own) == [variable]
    assert ways_out_of(tmp_path) == []
    assert ways_out_of(tmp_path / "out" / "product") == []
    denied = PermissionError(13, "Permission denied", str(own / "x"))
    assert f"Set {variable} to what" in file_trouble(denied)
    assert "Change its permissions" in file_trouble(PermissionError(13, "Permission denied", str(tmp_path / "out")))
