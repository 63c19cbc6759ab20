"""The index of a large store: a folder of parts that stay what they are when other products change."""

import json
import random
import shutil
from pathlib import Path

import pandas as pd
import pyarrow.dataset
import pytest
from small_product import small_publication

from tasks.objectstore.index_upload import upload_index
from tasks.objectstore.location import open_object_store
from tasks.publish import index_parts as parts
from tasks.publish import publish
from tasks.publish.index import INDEX, open_index, read_index, rebuild_index, update_index


@pytest.fixture(scope="module")
def product(tmp_path_factory) -> Path:
    """The two files that a row is read from."""
    store = tmp_path_factory.mktemp("one")
    publish(small_publication("C0001"), store)
    whole = store / "C0001"
    small = store / ".small"
    (small / "cube.zarr").mkdir(parents=True)
    for name in ("cube.zarr/zarr.json", "result.json"):
        shutil.copyfile(whole / name, small / name)
    return small


@pytest.fixture(autouse=True)
def small_parts(monkeypatch):
    monkeypatch.setattr(parts, "PART_ROWS", 3)


def put(product: Path, store: Path, name: str, limb_rms_px: float = 0.31) -> None:
    """A product, with another result each time, as the publisher exchanges it."""
    fresh = store / f".{name}"
    shutil.copytree(product, fresh)
    result = json.loads((fresh / "result.json").read_text()) | {"limb_rms_px": limb_rms_px}
    (fresh / "result.json").write_text(json.dumps(result))
    shutil.rmtree(store / name, ignore_errors=True)
    fresh.rename(store / name)


def filled(product: Path, store: Path, count: int) -> list[str]:
    store.mkdir(exist_ok=True)
    names = [f"P{number:02d}" for number in range(count)]
    for name in names:
        put(product, store, name)
    return names


def states(store: Path) -> dict[str, tuple[int, int]]:
    return {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in parts.part_paths(store)}


def test_a_small_store_has_one_file_and_a_large_one_a_folder_that_opens_as_one_table(product, tmp_path, caplog):
    filled(product, tmp_path, 3)
    open_index(tmp_path)
    assert (tmp_path / INDEX).is_file()
    put(product, tmp_path, "P03")
    update_index(tmp_path, ["P03"])
    assert [path.name for path in parts.part_paths(tmp_path)] == ["part-00000.parquet", "part-00001.parquet"]
    assert "index of 4 images is a folder of 2 files now" in caplog.text
    plain = pd.read_parquet(tmp_path / INDEX)
    assert list(plain["product"]) == ["P00", "P01", "P02", "P03"]
    assert pyarrow.dataset.dataset(tmp_path / INDEX).count_rows() == 4
    pd.testing.assert_frame_equal(open_index(tmp_path), plain)


def test_a_new_product_touches_the_last_part_and_a_changed_one_its_own(product, tmp_path):
    filled(product, tmp_path, 8)
    open_index(tmp_path)
    before = states(tmp_path)
    put(product, tmp_path, "P08")
    assert update_index(tmp_path, ["P08"]) == 9
    after = states(tmp_path)
    assert [name for name in after if after[name] != before.get(name)] == ["part-00002.parquet"]
    put(product, tmp_path, "P01", 0.7)
    update_index(tmp_path, ["P01"])
    last = states(tmp_path)
    assert [name for name in last if last[name] != after.get(name)] == ["part-00000.parquet"]
    assert read_index(tmp_path).set_index("product").loc["P01", "limb_rms_px"] == 0.7


@pytest.mark.parametrize("seed", range(4))
def test_after_any_changes_every_product_has_one_row_that_is_true(product, tmp_path, seed):
    """By updates of what is known to have changed, by comparison, and by a new index: the same table."""
    chance, names = random.Random(seed), [f"P{number:02d}" for number in range(14)]
    filled(product, tmp_path, 2)
    open_index(tmp_path)
    for _ in range(12):
        changed = chance.sample(names, chance.choice((1, 1, 2, 5)))
        for name in changed:
            if chance.random() < 0.25:
                shutil.rmtree(tmp_path / name, ignore_errors=True)
            else:
                put(product, tmp_path, name, round(chance.random(), 6))
        update_index(tmp_path, changed) if chance.random() < 0.7 else open_index(tmp_path)
        assert all(len(pd.read_parquet(path)) <= 3 for path in parts.part_paths(tmp_path))
        plain = pd.read_parquet(tmp_path / INDEX).sort_values("product", ignore_index=True)
        assert list(plain["product"]) == sorted(path.name for path in tmp_path.glob("P*"))
    expected = rebuild_index(tmp_path).sort_values("product", ignore_index=True)
    pd.testing.assert_frame_equal(plain, expected)


@pytest.mark.parametrize("content", [b"", b"PAR1 and then the power went"])
def test_a_damaged_part_costs_the_reading_of_its_own_rows(product, tmp_path, content, monkeypatch):
    filled(product, tmp_path, 8)
    expected = open_index(tmp_path)
    (tmp_path / INDEX / "part-00001.parquet").write_bytes(content)
    from tasks.publish import index as module

    read, row_of = [], module.row_of
    monkeypatch.setattr(module, "row_of", lambda folder, stamp: read.append(folder.name) or row_of(folder, stamp))
    put(product, tmp_path, "P07", 0.31)
    update_index(tmp_path, ["P07"])
    assert sorted(set(read)) == ["P03", "P04", "P05", "P07"]
    assert list(pd.read_parquet(tmp_path / INDEX)["product"]) == list(expected["product"])


def test_a_writer_that_dies_between_two_parts_leaves_every_product_once(product, tmp_path, monkeypatch):
    names = filled(product, tmp_path, 8)
    open_index(tmp_path)
    for name in names:
        put(product, tmp_path, name, 0.9)
    written, write = [], parts._write_part

    def dies(part, path):
        if len(written) == 2:
            raise KeyboardInterrupt
        written.append(path)
        write(part, path)

    with monkeypatch.context() as patch:
        patch.setattr(parts, "_write_part", dies)
        with pytest.raises(KeyboardInterrupt):
            update_index(tmp_path, names)
    plain = pd.read_parquet(tmp_path / INDEX)
    assert sorted(plain["product"]) == names
    assert set(plain["limb_rms_px"]) == {0.31, 0.9}
    assert set(open_index(tmp_path)["limb_rms_px"]) == {0.9}


def test_a_large_index_in_one_file_as_earlier_versions_wrote_it_becomes_a_folder(product, tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(parts, "PART_ROWS", 100)
        filled(product, tmp_path, 8)
        old = open_index(tmp_path)
        assert (tmp_path / INDEX).is_file()
    pd.testing.assert_frame_equal(open_index(tmp_path), old)  # readers need no new form
    put(product, tmp_path, "P08")
    update_index(tmp_path, ["P08"])
    assert len(parts.part_paths(tmp_path)) == 3
    assert len(open_index(tmp_path)) == 9
    assert [path.name for path in tmp_path.glob(".*.tmp")] == []


def test_a_store_that_may_not_be_written_to_has_its_index_in_memory(product, tmp_path):
    filled(product, tmp_path, 5)
    open_index(tmp_path)
    put(product, tmp_path, "P05")
    # A file that nobody may open for writing, not even root.
    (tmp_path / ".index.lock").unlink()
    (tmp_path / ".index.lock").mkdir()
    assert update_index(tmp_path, ["P05"]) == 0
    assert len(open_index(tmp_path)) == 6


def test_an_object_store_gets_the_parts_that_changed(product, tmp_path):
    mirror, store = tmp_path / "mirror", open_object_store(f"memory://{tmp_path.name}")
    filled(product, mirror, 3)
    open_index(mirror)
    assert upload_index(mirror, store) == 1
    filled(product, mirror, 8)
    open_index(mirror)
    assert upload_index(mirror, store) == 3
    assert not store.files.isfile(store.path(INDEX))
    put(product, mirror, "P08")
    open_index(mirror)
    assert upload_index(mirror, store) == 1
    assert upload_index(mirror, store) == 0
    assert len(pd.read_parquet(f"{store.url}/{INDEX}")) == 9
