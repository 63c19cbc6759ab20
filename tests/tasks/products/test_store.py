"""The store's index and the check of products: what they say, what damage they find."""

import json
import shutil
import threading
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from small_product import small_publication

from catalog.errors import RefusedError
from tasks.publish import publish
from tasks.publish.check import product_faults, products_in
from tasks.publish.checksums import CHECKSUMS, write_checksums
from tasks.publish.index import INDEX, open_index, open_store, rebuild_index
from tasks.publish.index_rows import NAMES, row_of, stamp_of


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    store = tmp_path_factory.mktemp("published")
    for product in ("C0001", "C0002"):
        publish(small_publication(product), store)
    return store


@pytest.fixture
def store(published, tmp_path):
    shutil.copytree(published, tmp_path / "store")
    return tmp_path / "store"


def texts(folder):
    return "\n".join(map(str, product_faults(folder)))


def test_the_index_is_one_parquet_file_that_pandas_opens_with_one_call(store):
    opened = open_index(store)
    index = pd.read_parquet(store / INDEX)
    pd.testing.assert_frame_equal(index, opened)
    assert tuple(index.columns) == NAMES
    assert list(index["product"]) == ["C0001", "C0002"]
    row = index.iloc[0]
    pose = small_publication("C0001").pose_after
    assert row["status"] == "ok"
    assert row["range_km"] == pytest.approx(pose.range_km)
    assert row["phase_deg"] == pytest.approx(pose.phase_deg)
    assert row["utc"] == pd.Timestamp(pose.to_dict()["utc"])
    assert row["limb_rms_px"] == 0.31
    assert row["image_sha256"] == "ab12"
    assert np.isnan(row["similarity_after"])
    with xr.open_zarr(store / row["cube"]) as cube:
        nearest = cube["emission"].values == np.nanmin(cube["emission"].values)
        assert abs(float(cube["latitude"].values[nearest][0]) - row["sub_observer_latitude_deg"]) < 0.5
        assert abs(float(cube["longitude"].values[nearest][0]) - row["sub_observer_longitude_deg"]) < 0.5
        best = float(np.nanmin(cube["resolution_km"].values))
        assert best == pytest.approx(row["resolution_km"], rel=1e-3)
        sunny = cube["incidence"].values == np.nanmin(cube["incidence"].values)
        assert abs(float(cube["latitude"].values[sunny][0]) - row["sub_solar_latitude_deg"]) < 1


def test_the_index_notices_new_changed_and_deleted_products_and_reads_only_those(store, monkeypatch):
    open_index(store)
    read = []

    def noted(folder, stamp):
        read.append(folder.name)
        return row_of(folder, stamp)

    monkeypatch.setattr("tasks.publish.index.row_of", noted)
    open_index(store)
    assert read == []
    publish(small_publication("C0003"), store)
    publish(small_publication("C0001", result={"status": "ok", "limb_rms_px": 0.5}), store)
    index = open_index(store).set_index("product")
    assert sorted(read) == ["C0001", "C0003"]
    assert index.loc["C0001", "limb_rms_px"] == 0.5
    shutil.rmtree(store / "C0002")
    assert list(open_index(store)["product"]) == ["C0001", "C0003"]
    assert open_index(store).dtypes.equals(index.reset_index().dtypes[list(NAMES)])
    assert list(pd.read_parquet(store / INDEX)["product"]) == ["C0001", "C0003"]


@pytest.mark.parametrize("content", [b"", b"PAR1 and then the power went", None])
def test_a_damaged_or_missing_index_is_made_again_from_the_cubes(store, content):
    expected = open_index(store)
    (store / INDEX).unlink() if content is None else (store / INDEX).write_bytes(content)
    pd.testing.assert_frame_equal(open_index(store), expected)
    pd.testing.assert_frame_equal(pd.read_parquet(store / INDEX), expected)
    pd.testing.assert_frame_equal(rebuild_index(store), expected)


def test_of_several_writers_none_loses_anothers_product(store):
    def publish_and_index(product):
        shutil.copytree(store / "C0001", store / f".{product}")
        (store / f".{product}").rename(store / product)
        open_index(store)

    names = [f"N{i}" for i in range(6)]
    threads = [threading.Thread(target=publish_and_index, args=(name,)) for name in names]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set(pd.read_parquet(store / INDEX)["product"]) == {"C0001", "C0002", *names}
    assert [p.name for p in store.iterdir() if p.name.endswith(".tmp")] == []


def test_a_product_whose_cube_cannot_be_read_has_a_row_that_says_so(store):
    (store / "C0002" / "cube.zarr" / "zarr.json").write_text("{")
    index = open_index(store).set_index("product")
    assert index.loc["C0002", "status"] == "unreadable"
    assert "JSON" in index.loc["C0002", "reason"]
    assert list(open_store(store).children) == ["C0001"]


def test_a_store_opens_as_one_lazy_tree(store):
    tree = open_store(store)
    assert set(tree.children) == {"C0001", "C0002"}
    assert tree["C0002/incidence"].chunks is not None
    with xr.open_datatree(store / "C0001" / "cube.zarr", engine="zarr", chunks={}) as one:
        assert one["latitude"].chunks is not None


def test_an_empty_store_has_an_empty_index_and_no_store_is_refused(tmp_path):
    empty = open_index(tmp_path)
    assert (len(empty), tuple(empty.columns)) == (0, NAMES)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(RefusedError, match="no store"):
        open_index(tmp_path / "nowhere")
    with pytest.raises(RefusedError, match="no product"):
        products_in(tmp_path)
    assert stamp_of(tmp_path) is None


def flip_a_byte(folder: Path) -> None:
    chunk = folder / "cube.zarr" / "image" / "c" / "0" / "0"
    content = bytearray(chunk.read_bytes())
    content[len(content) // 2] ^= 1
    chunk.write_bytes(content)


def set_attribute(folder: Path, variable: str, key: str, value: object) -> None:
    """In the array's own metadata and in the consolidated ones."""
    own, group = folder / "cube.zarr" / variable / "zarr.json", folder / "cube.zarr" / "zarr.json"
    content, whole = json.loads(own.read_text()), json.loads(group.read_text())
    content["attributes"][key] = value
    whole["consolidated_metadata"]["metadata"][variable]["attributes"][key] = value
    own.write_text(json.dumps(content))
    group.write_text(json.dumps(whole))


def set_group_attribute(folder: Path, key: str, value: object) -> None:
    group = folder / "cube.zarr" / "zarr.json"
    content = json.loads(group.read_text())
    content["attributes"] |= {key: value}
    if value is None:
        del content["attributes"][key]
    group.write_text(json.dumps(content))


def another_pose(folder: Path) -> None:
    """Half a pixel to the right."""
    pose = small_publication("C0001").pose_after
    moved = pose.replaced(target_from_spacecraft_km=pose.target_from_spacecraft_km + np.array([13.0, 0, 0]))
    set_group_attribute(folder, "pose_after", json.dumps(moved.to_dict()))


DAMAGES = {
    "flipped byte": (flip_a_byte, "image/c/0/0 has changed", None),
    "deleted chunk": (
        lambda f: (f / "cube.zarr" / "phase" / "c" / "0" / "0").unlink(),
        "phase/c/0/0 is missing",
        "phase: finite values and the off_body flag disagree",
    ),
    "wrong units": (
        lambda f: set_attribute(f, "emission", "units", "radian"),
        "emission/zarr.json has changed",
        "emission: attribute units is 'radian'",
    ),
    "another pose": (another_pose, "cube.zarr/zarr.json has changed", "geometry: longitude differs"),
    "no provenance": (
        lambda f: set_group_attribute(f, "provenance", None),
        "cube.zarr/zarr.json has changed",
        "attribute provenance is missing",
    ),
    "empty provenance": (
        lambda f: set_group_attribute(f, "provenance", "{}"),
        "cube.zarr/zarr.json has changed",
        "provenance lacks image, kernels",
    ),
    "no cube": (lambda f: shutil.rmtree(f / "cube.zarr"), "cube.zarr is missing", "cube.zarr is missing"),
    "broken result": (
        lambda f: (f / "result.json").write_text("{"),
        "result.json has changed",
        "result.json cannot be read",
    ),
    "an extra file": (lambda f: (f / "notes.txt").write_text("mine"), "notes.txt is not among", None),
    "renamed folder": (lambda f: set_group_attribute(f, "product", "C9"), "has changed", "the cube is of C9"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damage_is_found_by_its_digest_and_where_it_can_by_what_it_means(store, damage):
    spoil, by_digest, by_meaning = DAMAGES[damage]
    folder = store / "C0001"
    assert product_faults(folder) == []
    spoil(folder)
    assert by_digest in texts(folder)
    if by_meaning:
        write_checksums(folder)  # as a writer would who publishes what is wrong
        assert by_meaning in texts(folder)
        assert product_faults(store / "C0002") == []


def test_a_product_without_checksums_is_a_fault(store):
    (store / "C0001" / CHECKSUMS).unlink()
    assert "SHA256SUMS is missing" in texts(store / "C0001")
    (store / "C0001" / CHECKSUMS).write_text("nonsense\n")
    assert "no checksum: 'nonsense'" in texts(store / "C0001")


def test_the_flow_brings_the_index_up_to_date_only_for_what_it_published(store):
    from tasks.objectstore.places import note_in_index

    note_in_index(store, {"status": "refused", "cached": []})
    note_in_index(store, {"status": "ok", "cached": ["ingest", "publish"]})
    assert not (store / INDEX).exists()
    note_in_index(store, {"status": "doubtful", "cached": ["ingest"]})
    assert len(pd.read_parquet(store / INDEX)) == 2


def test_a_batch_brings_the_index_up_to_date_in_proportion_and_at_its_end(monkeypatch):
    from tasks.objectstore import places

    new, old, rows = {"status": "ok", "cached": []}, {"status": "ok", "cached": ["publish"]}, []
    published = 0

    def indexed(store):
        assert store == Path("a")
        rows.append(published)
        return published

    monkeypatch.setattr(places, "index_store", indexed)
    with places.Indexing() as indexing:
        for published in range(1, 2001):
            indexing.note(Path("a"), new)
            indexing.note(Path("b"), old)
            assert published <= (1 + places.SHARE) * (rows[-1] if rows else 0) + 1
    assert rows[0] == 1
    assert rows[-1] == 2000
    assert sum(rows) < 2 * (1 + 1 / places.SHARE) * 2000


def test_an_interrupted_batch_leaves_the_index_of_what_it_published(store):
    from tasks.objectstore.places import Indexing

    def batch():
        with Indexing() as indexing:
            indexing.note(store, {"status": "ok", "cached": []})
            shutil.copytree(store / "C0001", store / "C0009")
            indexing._rows[store] = 1000
            indexing.note(store, {"status": "ok", "cached": []})
            assert len(pd.read_parquet(store / INDEX)) == 2
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch()
    assert len(pd.read_parquet(store / INDEX)) == 3


def test_the_benchmark_of_the_index_opens_every_row_here_and_in_a_new_process():
    """At a fiftieth of its size; how long it takes is for `planetpose benchmark index` to say (0.03 s, bar 1 s)."""
    from lab.benchmark.index import benchmark_index

    figures = benchmark_index(20)
    print(figures)
    assert figures["products"] == figures["rows_in_new_process"] == 20
    assert figures["open_s"] > 0


def test_a_sample_of_a_large_store_looks_into_few_folders(tmp_path, monkeypatch):
    from tasks.objectstore import checked

    for number in range(40):
        (tmp_path / f"P{number}").mkdir()
        if number % 2:
            (tmp_path / f"P{number}" / "record.json").touch()
    looked = []
    look = checked.has_product_files
    monkeypatch.setattr(checked, "has_product_files", lambda folder: looked.append(folder) or look(folder))
    found = checked.chosen_folders(tmp_path, 3, None)
    assert len(found) == 3
    assert all(int(folder.name[1:]) % 2 for folder in found)
    assert len(looked) < 40
    assert len(checked.chosen_folders(tmp_path, 100, None)) == 20
    assert checked.chosen_folders(tmp_path, 3, "P99") == []
    with pytest.raises(RefusedError, match="holds no product"):
        checked.chosen_folders(tmp_path / "P0", 3, None)


def test_a_check_takes_a_sample_or_goes_on_after_a_product(store):
    from tasks.objectstore.checked import chosen, each_checked

    for name in ("C0003", "C0004", "C0005"):
        shutil.copytree(store / "C0001", store / name)
    places = [Path(place).name for place, _ in each_checked([str(store)], after="C0003")]
    assert places == ["C0004", "C0005"]
    drawn = [tuple(Path(place).name for place, _ in each_checked([str(store)], sample=2)) for _ in range(1)]
    assert all(len(set(names)) == 2 and list(names) == sorted(names) for names in drawn)
    names = [f"P{number}" for number in range(9)]
    assert len({tuple(chosen(names, 3, None)) for _ in range(50)}) > 1
    assert chosen(names, 100, "P6") == ["P7", "P8"]
