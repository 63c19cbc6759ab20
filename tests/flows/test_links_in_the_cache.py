"""What a link in the cache leads to is somebody else's: neither clearing nor pruning deletes it."""

import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

from flows.cli import build_app
from tasks.atomic import folder_put_in_place, sweep_temporaries
from tasks.cache import cached_steps, prune, sweep_cache

OLD_S = 1_000_000_000.0


@pytest.fixture
def cache(tmp_path: Path) -> Path:
    """A cache with one result, and links at every depth to results elsewhere."""
    cache = tmp_path / "cache"
    for folder in (cache / "point/ab/abc", *(tmp_path / f"else/{depth}/cd/cde" for depth in range(3))):
        folder.mkdir(parents=True)
        (folder / "record.json").write_text("{}")
        os.utime(folder / "record.json", (OLD_S, OLD_S))
    (cache / "range").symlink_to(tmp_path / "else/0")
    (cache / "point/cd").symlink_to(tmp_path / "else/1/cd")
    (cache / "point/ab/cde").symlink_to(tmp_path / "else/2/cd/cde")
    return cache


def elsewhere(cache: Path) -> int:
    return len(list((cache.parent / "else").rglob("record.json")))


def test_pruning_deletes_what_is_in_the_cache_alone(cache: Path) -> None:
    assert [step.folder for step in cached_steps(cache)] == [cache / "point/ab/abc"]
    sweep_cache(cache)
    prune(cache, days=1)
    assert not (cache / "point/ab/abc").exists()
    assert elsewhere(cache) == 3


def test_clearing_follows_no_links_and_says_so(cache: Path) -> None:
    done = CliRunner().invoke(build_app(), ["cache", "clear"], env={"PLANETPOSE_CACHE": str(cache)})
    assert done.exit_code == 0
    assert f"{cache / 'range'} is a link" in done.output
    assert not (cache / "point").exists()
    assert elsewhere(cache) == 3


def test_a_product_that_was_a_link_is_replaced_and_what_it_led_to_stays(tmp_path: Path) -> None:
    (tmp_path / "disk/x").mkdir(parents=True)
    (tmp_path / "disk/x/old").touch()
    store = tmp_path / "store"
    store.mkdir()
    (store / "x").symlink_to(tmp_path / "disk/x")
    with folder_put_in_place(store / "x") as folder:
        (folder / "new").touch()
    assert [path.name for path in (store / "x").iterdir()] == ["new"]
    assert [path.name for path in store.iterdir()] == ["x"]
    assert (tmp_path / "disk/x/old").exists()


def test_an_abandoned_temporary_that_is_a_link_is_unlinked(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    link = tmp_path / f".x~{os.uname().nodename}~999999999~abc.tmp"
    link.symlink_to(tmp_path / "kept")
    sweep_temporaries(tmp_path)
    assert not link.is_symlink()
    assert (tmp_path / "kept").is_dir()
