"""A store in S3, against moto's server: whole products or none, whatever dies in between."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalog.errors import FailedError, RefusedError
from tasks.objectstore import listing
from tasks.objectstore.location import ObjectStore, open_object_store
from tasks.objectstore.publishing import CUBE_OPENER, publish_product, published_key
from tasks.objectstore.reading import download_product, object_store_index, publish_index, whole_products
from tasks.objectstore.step import STEP as UPLOAD
from tasks.objectstore.step import UploadFiles, UploadInputs
from tasks.publish.checksums import checksum_faults, write_checksums
from tasks.publish.index import INDEX
from tasks.publish.names import CUBE
from tasks.record import RECORD_FILE
from tasks.step import AnyStep, Step, run

pytestmark = pytest.mark.filterwarnings("ignore:Failed to open Zarr store with consolidated")


def write_product(store: Path, key: str, value: float = 1.0, extra: bool = False) -> Path:
    """A product with a real cube; `extra`: and one more file."""
    import xarray as xr

    folder = store / "C0001"
    folder.mkdir(parents=True, exist_ok=True)
    image = xr.Dataset({"image": (("y", "x"), np.full((8, 8), value, np.float32))}, attrs={"value": value})
    image.to_zarr(folder / "cube.zarr", mode="w", consolidated=False, zarr_format=3)
    (folder / "result.json").write_text(json.dumps({"product": "C0001", "status": "ok"}))
    if extra:
        (folder / "extra.txt").write_text("older version")
    write_checksums(folder)
    (folder / RECORD_FILE).write_text(json.dumps({"key": key}))
    return folder


def fields(store: ObjectStore) -> set[str]:
    return {path.partition("/C0001/")[2] for path in store.files.find(store.root)}


def test_a_published_cube_opens_by_its_s3_address_and_equals_the_local_one(url: str, tmp_path: Path) -> None:
    import xarray as xr

    copied = publish_product(write_product(tmp_path, "k1", 3.0), open_object_store(url))
    with xr.open_zarr(f"{url}/C0001/cube.zarr") as cube, xr.open_zarr(tmp_path / "C0001" / "cube.zarr") as local:
        xr.testing.assert_identical(cube.load(), local.load())
    assert copied.files == sum(path.is_file() for path in (tmp_path / "C0001").rglob("*"))
    assert published_key(open_object_store(url), "C0001") == "k1"


def test_a_newer_product_replaces_the_older_one_and_leaves_nothing_of_it(url: str, tmp_path: Path) -> None:
    store = open_object_store(url)
    publish_product(write_product(tmp_path / "old", "k1", 1.0, extra=True), store)
    copied = publish_product(write_product(tmp_path / "new", "k2", 2.0), store)
    assert copied.deleted == 1
    assert "extra.txt" not in fields(store)
    assert published_key(store, "C0001") == "k2"
    back = download_product(store, "C0001", tmp_path / "back")
    assert checksum_faults(back) == []


@pytest.mark.parametrize("puts", range(4))
def test_a_writer_that_dies_leaves_no_product_and_the_next_one_mends_it(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, puts: int
) -> None:
    import xarray as xr

    store = open_object_store(f"{url}-{puts}")
    publish_product(write_product(tmp_path / "old", "k1", 1.0), store)
    newer = write_product(tmp_path / "new", "k2", 2.0)
    done: list[str] = []

    def dies(put: Any) -> Any:
        def putting(*arguments: Any, **options: Any) -> Any:
            if len(done) == puts:
                raise KeyboardInterrupt
            done.append("put")
            return put(*arguments, **options)

        return putting

    with monkeypatch.context() as patch:
        patch.setattr(store.files, "put", dies(store.files.put))
        patch.setattr(store.files, "put_file", dies(store.files.put_file))
        with pytest.raises(KeyboardInterrupt):
            publish_product(newer, store)
    assert published_key(store, "C0001") is None
    assert whole_products(store) == {}
    if CUBE_OPENER not in fields(store):
        with pytest.raises((FileNotFoundError, KeyError)):
            xr.open_zarr(f"{store.url}/C0001/cube.zarr", consolidated=False)
    publish_product(newer, store)
    with xr.open_zarr(f"{store.url}/C0001/cube.zarr") as cube:
        assert float(cube["image"].min()) == float(cube["image"].max()) == cube.attrs["value"] == 2.0
    assert checksum_faults(download_product(store, "C0001", tmp_path / "back")) == []


def test_what_other_products_are_called_does_not_matter(url: str, tmp_path: Path) -> None:
    store = open_object_store(url)
    publish_product(write_product(tmp_path, "k1"), store)
    store.files.pipe_file(store.path("C00011", "cube.zarr", "zarr.json"), b"{}")
    store.files.pipe_file(store.path("index.parquet"), b"")
    publish_product(write_product(tmp_path, "k2"), store)
    assert list(whole_products(store)) == ["C0001"]
    assert store.files.exists(store.path("C00011", "cube.zarr", "zarr.json"))


@pytest.mark.parametrize("page", [1, 2, 7, 1000])
def test_products_are_found_by_listings_alone_whatever_the_size_of_a_page(
    url: str, monkeypatch: pytest.MonkeyPatch, page: int
) -> None:
    store = open_object_store(f"{url}-{page}")
    whole, hidden = ["(first", "+b", "A1", "Z", "_c", "z9"], ".reprocess/images"
    for name in whole:
        for number in range(4):
            store.files.pipe_file(store.path(name, CUBE, f"plane{number}", "c"), b"1")
        for part in ("record.json", "result.json"):
            store.files.pipe_file(store.path(name, part), b"{}")
    store.files.pipe_file(store.path("begun", CUBE, "image", "c"), b"1")  # no record: not whole
    for number in range(9):
        store.files.pipe_file(store.path(hidden, f"p{number}.json"), b"{}")
    store.files.pipe_file(store.path("index.parquet", "part-00000.parquet"), b"")
    store.files.pipe_file(f"{store.root}-beside/other/record.json", b"{}")
    monkeypatch.setattr(listing, "PAGE", page)
    requests: list[str] = []
    call = store.files.call_s3
    monkeypatch.setattr(store.files, "call_s3", lambda name, **given: requests.append(name) or call(name, **given))
    found = whole_products(store)
    assert list(found) == sorted(whole)
    assert found == pytest.approx(listing.looked_up_records(store), abs=1.0)
    sizes = {f"{CUBE}/plane{number}/c": 1 for number in range(4)} | {"record.json": 2, "result.json": 2}
    assert listing.sizes_below(store, "A1") == sizes
    assert listing.sizes_below(store, "A") == {}
    assert set(requests) == {"list_objects_v2"}
    if page == 1000:
        assert len(requests) == 3


def step_of(url: str, folder: Path, key: str) -> AnyStep:
    inputs = UploadInputs(url=url, product="C0001", publish=key)
    return Step(UPLOAD, "upload", "C0001", folder.parent / "cache", inputs, UploadFiles(folder))


def test_the_step_asks_the_store_whether_it_is_done(url: str, tmp_path: Path) -> None:
    folder = write_product(tmp_path, "k1")
    step = step_of(url, folder, "k1")
    assert step.record() is None
    assert run(step, lambda *_: None).result["files"] > 0
    assert step.record() is not None
    store = open_object_store(url)
    store.files.rm_file(store.path("C0001", RECORD_FILE))
    assert step.record() is None  # whatever the cache says
    run(step, lambda *_: None)
    assert step.record() is not None
    assert step_of(url, folder, "k2").record() is None


def test_the_index_follows_the_products_in_the_store(url: str, tmp_path: Path) -> None:
    import pandas as pd

    store, mirror = open_object_store(url), tmp_path / "mirror"
    publish_product(write_product(tmp_path / "a", "k1"), store)
    table = publish_index(store, mirror)
    assert list(table["product"]) == ["C0001"]
    assert list(pd.read_parquet(f"{url}/{INDEX}")["cube"]) == ["C0001/cube.zarr"]
    store.files.rm_file(store.path("C0001", RECORD_FILE))
    assert len(object_store_index(store, mirror)) == 0


def test_a_store_that_is_not_there_or_may_not_be_used_is_reported(
    s3: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_product(tmp_path, "k1")
    with pytest.raises(FailedError, match="bucket") as missing:
        publish_product(folder, open_object_store("s3://nowhere/at-all"))
    assert missing.value.code == "store-missing"
    with pytest.raises(RefusedError, match="names no bucket"):
        open_object_store("s3://")
    with pytest.raises(RefusedError, match="ftp42"):
        open_object_store("ftp42://host/folder")


def test_a_lost_connection_is_a_fault_that_can_pass(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from botocore.exceptions import EndpointConnectionError

    from flows.reprocessing.worker import can_pass

    store = open_object_store(url)

    def lost(*_: str, **__: str) -> bytes:
        raise EndpointConnectionError(endpoint_url="http://127.0.0.1:9")

    monkeypatch.setattr(store.files, "call_s3", lost)
    with pytest.raises(FailedError, match="cannot be reached") as unreachable:
        published_key(store, "C0001")
    assert can_pass(unreachable.value)


def test_names_in_a_store_do_not_leave_the_folder_they_are_copied_to(url: str, tmp_path: Path) -> None:
    store = open_object_store(url)
    publish_product(write_product(tmp_path, "k1"), store)
    for name in ("../C0001", "..", "C0001/cube.zarr", ""):
        with pytest.raises(RefusedError):
            download_product(store, name, tmp_path / "back")


def test_an_image_is_corrected_into_the_store_and_a_lost_copy_costs_only_the_copying(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import xarray as xr

    from flows.chain import Chain
    from flows.image import correct_image
    from flows.one_image import answer_from_cache
    from flows.request import Request
    from flows.result import result_of
    from lab.simulate.small_archive import CAMERA_FILE, POSE_FILE, PROFILE_FILE, write_small_archive
    from tasks.objectstore.places import place_of

    monkeypatch.setenv("PLANETPOSE_STATE", str(tmp_path / "state"))
    archive = write_small_archive(tmp_path / "archive", 1).parent
    place = place_of(url)
    request = Request(
        image=archive / "small-00000.png",
        store=place.store,
        publish_to=place.publish_to,
        camera=str(archive / CAMERA_FILE),
        target="europa",
        pose_file=archive / POSE_FILE,
        profile=str(archive / PROFILE_FILE),
        kernels=(),
        cache=tmp_path / "cache",
    )

    def corrected() -> dict[str, Any]:
        chain = Chain(request, lambda step: run(step, lambda *_: None))
        correct_image(chain)
        return result_of(chain)

    assert answer_from_cache(request) is None
    first = corrected()
    assert first["cube"] == f"{url}/small-00000/cube.zarr"
    with xr.open_zarr(first["cube"]) as cube:
        assert cube.attrs["product"] == "small-00000"
    cached = answer_from_cache(request)
    assert cached is not None
    assert cached["cube"] == first["cube"]
    store = open_object_store(url)
    store.files.rm_file(store.path("small-00000", RECORD_FILE))
    assert answer_from_cache(request) is None
    again = corrected()
    assert set(again["seconds"]) - set(again["cached"]) == {"upload"}
    assert checksum_faults(download_product(store, "small-00000", tmp_path / "back")) == []
