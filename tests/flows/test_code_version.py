"""The version of a step's code follows its sources."""

from pathlib import Path

import pytest

from tasks import code_version as module


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small project: room `a` uses catalog.shapes and, inside a function, room `b`; nobody uses catalog.unused."""
    files = {
        "catalog/__init__.py": "",
        "catalog/shapes.py": "RADIUS = 1\n",
        "catalog/deep.py": "X = 1\n",
        "catalog/unused.py": "X = 1\n",
        "tasks/__init__.py": "",
        "tasks/a/__init__.py": "from catalog.shapes import RADIUS\n",
        "tasks/a/brick.py": "def f():\n    from tasks.b import (\n        g,\n        h,\n    )\n    return g, h\n",
        "tasks/b/__init__.py": "from catalog import deep\n\ndef g():\n    return deep.X\n",
        "tasks/c/__init__.py": "",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(module, "ROOT", tmp_path)
    return tmp_path


def version(name: str) -> str:
    for function in (module.code_version, module._sources, module._imports):
        function.cache_clear()
    return module.code_version(name)


@pytest.fixture(autouse=True)
def forget() -> object:
    yield
    for function in (module.code_version, module._sources, module._imports):
        function.cache_clear()


@pytest.mark.parametrize("changed", ["tasks/a/brick.py", "catalog/shapes.py", "tasks/b/__init__.py", "catalog/deep.py"])
def test_it_changes_with_every_file_that_the_step_reaches(project: Path, changed: str) -> None:
    before = version("tasks.a")
    path = project / changed
    path.write_text(path.read_text().replace("1", "2") + "# changed\n")
    assert version("tasks.a") != before


@pytest.mark.parametrize("changed", ["catalog/unused.py", "tasks/c/__init__.py"])
def test_it_stays_when_files_change_that_the_step_does_not_reach(project: Path, changed: str) -> None:
    before = version("tasks.a")
    (project / changed).write_text("# changed\n")
    assert version("tasks.a") == before


def test_a_new_brick_in_the_room_counts(project: Path) -> None:
    before = version("tasks.a")
    (project / "tasks/a/new_brick.py").write_text("X = 1\n")
    assert version("tasks.a") != before


def test_the_real_steps_reach_the_code_they_run() -> None:
    names = {path.relative_to(module.ROOT).as_posix() for path in module._reached_from("tasks.point.step")}
    assert {"tasks/point/loop.py", "tasks/simulate/scene.py", "catalog/pose.py", "tasks/correcting.py"} <= names
    assert not any(name.startswith(("flows/", "tasks/publish/", "tasks/attitude/")) for name in names)
    assert "tasks/step.py" not in names  # the machinery may change without redoing everything
