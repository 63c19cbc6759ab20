"""The tutorial runs on the real image, and prints what it shows."""

import os
import shutil
import sys
from pathlib import Path

import pytest
from real_bench import PLANETPOSE, ROOT, Bench

from tasks.profile import find_profile

sys.path.insert(0, str(ROOT / "docs"))

from building.examples import examples_in, fault_of

pytestmark = pytest.mark.real

EUROPA = "galileo/C0552809300R.IMG"
DOCUMENTS = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md"]
PAGES = [page for page in DOCUMENTS if any(example.world == "europa" for example in examples_in(page))]


@pytest.fixture(scope="module")
def folder(bench: Bench) -> Path:
    """A folder with the image and a command `planetpose`; its steps are already in the cache, so that no server is
    needed."""
    here = bench.folder / "tutorial"
    here.mkdir()
    shutil.copy(bench.image(EUROPA), here)
    result = bench.correct(here / "C0552809300R.IMG", store="tutorial/out", profile=find_profile("joint"))
    assert result["status"] == "ok", result["reason"]
    command = here / "bin" / "planetpose"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{PLANETPOSE[0]}" -c "{PLANETPOSE[2]}" "$@"\n')
    command.chmod(0o755)
    return here


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_page_runs_and_prints_what_it_shows(
    page: Path, folder: Path, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")} | {
        "PATH": f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "PLANETPOSE_CACHE": str(bench.cache),
        "PLANETPOSE_STATE": str(bench.folder / "state"),
        "PLANETPOSE_KERNELS": "",
    }
    names: dict[str, object] = {}
    faults = [fault_of(example, folder, environment, names) for example in examples_in(page)]
    assert [fault for fault in faults if fault] == []
