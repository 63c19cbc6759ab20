"""Fixtures of the tests on real files; the helpers of this folder are imported by name."""

import os
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parent / "helpers"))

from real_bench import Bench

from tasks.profile import find_profile


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory, data_folder: Path) -> Bench:
    """Where real images are corrected: a store for the session, and a cache that all processes of the test run share
    (its keys hold everything that a step depends on, the code too)."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    return Bench(tmp_path_factory.mktemp("bench"), data_folder, shared / "bench-cache")


@pytest.fixture(scope="session")
def europa(bench: Bench) -> dict[str, Any]:
    """Europa by Galileo, corrected as it is by default."""
    return bench.correct(bench.image("galileo/C0552809300R.IMG"))


@pytest.fixture(scope="session")
def europa_by_limb(bench: Bench) -> dict[str, Any]:
    """The same by the standard profile, which trusts the limb."""
    image = bench.image("galileo/C0552809300R.IMG")
    return bench.correct(image, store="by-limb", profile=find_profile("standard"))
