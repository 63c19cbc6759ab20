"""Stores with planted phase functions, written once for all tests of what a store is for."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from lab.simulate.photometric_store import Planted, write_planted_store

PHASES_DEG = (12.0, 40.0, 70.0, 100.0)


@pytest.fixture(scope="session")
def planted_stores(tmp_path_factory) -> Callable[[str], tuple[Path, Planted]]:
    """Gives, for a law, a store whose images show it, and what was planted."""

    @cache
    def store_of(law: str) -> tuple[Path, Planted]:
        store = tmp_path_factory.mktemp(law)
        return store, write_planted_store(store, law, phases_deg=PHASES_DEG, size_px=48)

    return store_of


@pytest.fixture(scope="session", params=["lunar-lambert", "hapke"])
def planted(request, planted_stores) -> tuple[Path, Planted]:
    """A store of every law, and what was planted in it."""
    return planted_stores(request.param)


@pytest.fixture(scope="session")
def lunar_lambert_store(planted_stores) -> Path:
    """One store, for tests that only read it."""
    return planted_stores("lunar-lambert")[0]
