"""A user's own tasks.py, flows.py, catalog.py or lab.py, wherever it is, never stands for ours."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from catalog.children import LAUNCHER, our_command, our_module, their_module

MINE = "open({!r}, 'a').write(__name__ + chr(10)); raise SystemExit('a file of the user was executed')\n"
NAMES = ("tasks", "flows", "catalog", "viewer", "lab")
WHERE = """
import json, sys
import planetpose_launcher, flows, tasks.atomic, catalog.settings, lab
print(json.dumps([m.__file__ for m in (flows, tasks.atomic, catalog.settings, lab)]))
"""
POOL = """
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import planetpose_launcher
from catalog.settings import data_folder
if __name__ == "__main__":
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        pool.submit(data_folder).result()
    print("done")
"""


@pytest.fixture(params=["modules", "packages"])
def mine(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """A folder with the user's own, which leave a trace when they are executed."""
    folder = tmp_path / "mine"
    folder.mkdir()
    for name in NAMES:
        if request.param == "packages":
            (folder / name).mkdir()
        file = folder / (f"{name}.py" if request.param == "modules" else f"{name}/__init__.py")
        file.write_text(MINE.format(str(tmp_path / "executed")))
    return folder


def run(command: list[str], folder: Path, **more: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(folder), "PLANETPOSE_STATE": str(folder.parent / "state")} | more
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, stdin=subprocess.DEVNULL
    )
    assert not (folder.parent / "executed").exists(), (folder.parent / "executed").read_text()
    return done


@pytest.mark.parametrize("path", ["{mine}", "", "{mine}:", ":{mine}:."])
def test_the_command_is_ours(mine: Path, path: str) -> None:
    commands = [["server", "status"], ["--help"]] if path == "{mine}" else [["server", "status"]]
    for arguments in commands:
        done = run(our_command(*arguments), mine, PYTHONPATH=path.format(mine=mine))
        assert done.returncode == 0, done.stderr


def test_the_installed_command_is_ours(mine: Path) -> None:
    program = Path(sys.executable).parent / "planetpose"
    assert program.exists()
    done = run([str(program), "server", "status"], mine)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("module", ["lab.fuzz.child"])
def test_modules_that_we_start_are_ours(mine: Path, module: str) -> None:
    done = run(our_module(module, str(10**9)), mine)
    assert (done.returncode, json.loads(done.stdout)) == (0, {"ready": True}), done.stderr


def test_every_process_that_is_started_is_started_so() -> None:
    """Or `python -m` and `python -c` would put the working folder before everything else."""
    safe, unsafe = 'sys.executable, "-P"', 'sys.executable, "-'
    sources = [path for floor in NAMES for path in (LAUNCHER.parent / floor).rglob("*.py")]
    assert [path.name for path in sources if unsafe in path.read_text().replace(safe, "")] == []
    assert all("-P" in command for command in (our_command(), our_module("x"), their_module("x")))


def test_once_imported_the_launcher_gives_our_packages(mine: Path) -> None:
    code = f"import sys; sys.path.append({str(LAUNCHER.parent)!r})\n" + WHERE
    done = run([sys.executable, "-c", code], mine)
    assert done.returncode == 0, done.stderr
    assert all(file.startswith(str(LAUNCHER.parent)) for file in json.loads(done.stdout))


def test_processes_of_multiprocessing_get_our_packages(mine: Path) -> None:
    script = mine.parent / "script.py"
    script.write_text(f"import sys; sys.path.append({str(LAUNCHER.parent)!r})\n" + POOL)
    done = run([sys.executable, str(script)], mine)
    assert (done.returncode, done.stdout) == (0, "done\n"), done.stderr


def test_what_was_imported_before_under_our_names_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    import planetpose_launcher

    stranger: Any = type(sys)("tasks")
    stranger.__file__ = "/elsewhere/tasks.py"
    monkeypatch.setattr(sys, "modules", {"tasks": stranger, "tasks.more": stranger, "json": json})
    monkeypatch.setattr(sys, "meta_path", [])
    planetpose_launcher.pin()
    assert list(sys.modules) == ["json"]
    assert sys.meta_path == [planetpose_launcher.OwnPackages]


@pytest.mark.parametrize("set_by_user", [{}, {"OPENBLAS_NUM_THREADS": "3"}])
def test_blas_gets_one_thread_unless_the_environment_says_otherwise(
    set_by_user: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import planetpose_launcher

    for name in planetpose_launcher.ONE_THREAD:
        monkeypatch.delenv(name, raising=False)
    for name, value in set_by_user.items():
        monkeypatch.setenv(name, value)
    code = (
        "import json, os, sys\nfrom planetpose_launcher import ONE_THREAD, main\n"
        "sys.argv = ['planetpose', '-m', 'this']\nmain()\n"
        "print(json.dumps({name: os.environ[name] for name in ONE_THREAD}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    expected = dict.fromkeys(planetpose_launcher.ONE_THREAD, "1") | set_by_user
    assert json.loads(done.stdout.splitlines()[-1]) == expected
