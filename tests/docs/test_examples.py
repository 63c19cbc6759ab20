"""The examples of README and documentation run, and print what is shown."""

import os
import re
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "docs"), str(ROOT / "tests/tasks/products")]

from building.examples import alike, examples_in, fault_of  # noqa: E402
from small_product import pose_of, small_publication  # noqa: E402

from catalog.camera import Camera  # noqa: E402
from catalog.pose import write_pose_file  # noqa: E402
from catalog.target import Target  # noqa: E402
from tasks.profile import profile_of  # noqa: E402
from tasks.publish.index import open_index  # noqa: E402
from tasks.publish.product import publish  # noqa: E402

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
CHECKED = re.compile(r"^<!-- checked as: (\w+) -->\n```toml\n(.*?)^```", re.M | re.S)
CHECKS: dict[str, Callable[[dict[str, Any]], object]] = {
    "camera": Camera.model_validate,
    "target": Target.model_validate,
    "profile": profile_of,
}
WORLDS = ("store", "small", "europa")
HERE = [page for page in PAGES if any(example.world in ("store", "small") for example in examples_in(page))]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a store of two small products, and a pose file."""
    folder = tmp_path_factory.mktemp("world")
    for product in ("C0001", "C0002"):
        publish(small_publication(product), folder / "out")
    open_index(folder / "out")
    write_pose_file(pose_of(60.0), folder / "pose.json")
    return folder


def environment(world: Path) -> dict[str, str]:
    """Of commands: `planetpose` is this one, with its own cache and no kernels."""
    here = {
        "PLANETPOSE_CACHE": str(world / "cache"),
        "PLANETPOSE_STATE": str(world / "state"),
        "PLANETPOSE_KERNELS": "",
    }
    return os.environ | here | {"PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])}


@pytest.mark.parametrize("page", HERE, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_examples_run_and_print_what_is_shown(page: Path, world: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(world)
    names: dict[str, object] = {}
    for example in examples_in(page):
        if example.world in ("store", "small"):
            assert fault_of(example, world, environment(world), names) is None, f"{page}, line {example.line}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_files_that_are_shown_are_valid(page: Path) -> None:
    for kind, content in CHECKED.findall(page.read_text(encoding="utf-8")):
        CHECKS[kind]({"name": "own", **tomllib.loads(content)})


def test_every_example_has_a_world_that_is_run() -> None:
    examples = [example for page in PAGES for example in examples_in(page)]
    assert {example.world for example in examples} <= set(WORLDS)
    marks = sum(page.read_text(encoding="utf-8").count("<!-- run: ") for page in PAGES)
    assert len(examples) == marks >= 8


def test_numbers_may_differ_a_little_and_words_may_not() -> None:
    assert alike("offset (+7.39, +9.89) px", "offset (+7.41, +9.85) px")
    assert not alike("offset (+7.39, +9.89) px", "offset (+8.39, +9.89) px")
    assert not alike("status doubtful", "status ok")
    assert alike("range x 0.99961", "range x 0.99960")
    assert not alike("range x 0.99361", "range x 0.99960")
    assert alike("history: 12 of 13", "history: 12 ...")
