"""Fixtures of the tests on real files; the helpers of this folder are imported by name."""

import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parent / "helpers"))

from real_bench import Bench


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory, data_folder: Path) -> Bench:
    """Where real images are corrected: one cache and one store for the session."""
    return Bench(tmp_path_factory.mktemp("bench"), data_folder)


@pytest.fixture(scope="session")
def europa(bench: Bench) -> dict[str, Any]:
    """Europa by Galileo, corrected by the standard profile."""
    return bench.correct(bench.image("galileo/C0552809300R.IMG"))
