"""Machines that share nothing but S3: images at addresses, steps, leases, and what is remembered of a run."""

import json
import threading
from pathlib import Path
from typing import Any

import pytest

from catalog.errors import FailedError, RefusedError
from catalog.fetch.addresses import Addresses, with_addresses, with_files_in
from catalog.fetch.remote import have_image, image_had
from catalog.fetch.transfer import TransferError
from catalog.lists.location import address_in, parse_location
from flows.options import ReprocessOptions
from flows.request import Request
from tasks.objectstore.lease import LEASES, acquired, check_lease, leased
from tasks.objectstore.location import open_object_store
from tasks.objectstore.shared import name_of, obtain, share
from tasks.objectstore.state import pull_state, push_files
from tasks.record import Record, write_record
from tasks.step import AnyStep, Step, StepType
from tasks.work import NoFiles, Work

PIXELS = b"LBLSIZE=0 pixels"


def put(url: str, **files: bytes) -> None:
    store = open_object_store(url)
    for name, content in files.items():
        store.files.pipe_file(store.path(name.replace("_", ".")), content)


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("s3://bucket/a/b.img", "s3://bucket/a/b.img"),
        ("https:/host/b.img", "https://host/b.img"),
        ("S3:/bucket/b.img", "s3://bucket/b.img"),
        ("http://127.0.0.1:80/b.img", "http://127.0.0.1:80/b.img"),
        ("s3.img", None),
        ("folder/https:/x", None),
        ("europa57:b.img", None),
    ],
)
def test_a_path_of_a_command_line_is_known_as_the_address_that_was_given(text: str, address: str | None) -> None:
    assert address_in(Path(text)) == address


def test_files_at_addresses_have_the_same_place_below_the_folder_of_every_machine(tmp_path: Path) -> None:
    given = Request(
        image=Path("s3://bucket/a/b.img"),
        camera="https://host/camera.toml",
        target="europa",
        kernels=(Path("s3://bucket/k.bsp"), Path("/local/l.bsp")),
    )
    here = with_addresses(given, tmp_path / "here")
    assert here.image == tmp_path / "here" / "s3" / "bucket" / "a" / "b.img"
    assert here.camera == str(tmp_path / "here" / "host" / "camera.toml")
    assert here.target == "europa"
    assert here.kernels == (tmp_path / "here" / "s3" / "bucket" / "k.bsp", Path("/local/l.bsp"))
    assert here.image_place == "s3://bucket/a/b.img"
    there = with_files_in(Request.model_validate(here.model_dump(mode="json", by_alias=True)), tmp_path / "there")
    assert there.image == tmp_path / "there" / "s3" / "bucket" / "a" / "b.img"
    assert there.kernels == (tmp_path / "there" / "s3" / "bucket" / "k.bsp", Path("/local/l.bsp"))
    assert there.image_place == here.image_place
    with pytest.raises(RefusedError, match="no path of a file"):
        with_addresses(Request(image=Path("s3://bucket/../b.img"), product="b"), tmp_path)


def test_an_image_comes_with_the_label_beside_it_and_again_when_either_is_another_one(url: str, tmp_path: Path) -> None:
    put(url, C1_img=PIXELS)
    address = f"{url}/C1.img"
    path = tmp_path / parse_location(address).path
    first = have_image(address, tmp_path)
    assert (first.label, path.read_bytes()) == (None, PIXELS)
    put(url, C1_LBL=b"label")
    second = have_image(address, tmp_path)
    assert second.label == "C1.LBL"
    assert (path.parent / "C1.LBL").read_bytes() == b"label"
    assert image_had(address, tmp_path) == second
    known = Addresses(archive=tmp_path / "other", files={parse_location(address).path: address})
    image = known.archive / parse_location(address).path
    absent = known.unchanged(image, second.model_dump())
    assert absent is not None
    assert {file.path.name: file.sha256 for file in absent} == {
        "C1.img": second.sha256,
        "C1.LBL": second.label_sha256,
    }
    assert not image.exists()  # nothing was got for it
    put(url, C1_img=PIXELS + b"!")
    assert known.unchanged(image, second.model_dump()) is None
    assert have_image(address, tmp_path).sha256 != second.sha256
    assert path.read_bytes() == PIXELS + b"!"


def test_what_is_not_there_is_no_fault_that_can_pass_and_a_lost_connection_is(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from flows.reprocessing.worker import can_pass

    with pytest.raises(FailedError, match="no such file") as missing:
        have_image(f"{url}/nothing.img", tmp_path)
    assert not can_pass(missing.value)

    def away(_: str) -> str:
        raise TransferError("connection", "the storage cannot be reached", passing=True)

    monkeypatch.setattr("catalog.fetch.remote.version_of", away)
    with pytest.raises(FailedError, match="cannot be reached") as lost:
        have_image(f"{url}/C1.img", tmp_path)
    assert can_pass(lost.value)


def test_a_list_at_an_address_names_what_is_beside_it(url: str, tmp_path: Path) -> None:
    from flows.requests import requests_of_list

    text = b"product,image,camera,target,pose_file\none,one.img,camera.toml,europa,pose.json\n"
    put(url, images_csv=text)
    options = ReprocessOptions(
        images=f"{url}/images.csv", archive=tmp_path / "archive", cache=Path("s3://bucket/cache")
    )
    (request,) = requests_of_list(options)
    folder = tmp_path / "archive" / parse_location(f"{url}/x").path
    assert request.image == folder.with_name("one.img")
    assert request.pose_file == folder.with_name("pose.json")
    assert request.image_place == f"{url}/one.img"
    assert request.shared_cache == "s3://bucket/cache"
    assert request.addresses is not None
    assert set(request.addresses.files.values()) == {f"{url}/{n}" for n in ("one.img", "camera.toml", "pose.json")}


def step_in(cache: Path) -> AnyStep:
    from tasks.objectstore.step import UploadInputs, UploadResult

    def body(inputs: UploadInputs, files: NoFiles, work: Work) -> UploadResult:
        """Nothing."""
        raise NotImplementedError

    kind: StepType[Any, Any, Any] = StepType("point", body, UploadResult)
    inputs = UploadInputs(url="s3://x/y", product="one", publish="k")
    step = Step(kind, "point-1", "one", cache, inputs, NoFiles())
    step.__dict__["code"] = "c"  # the body is no module's
    return step


def test_a_step_that_one_machine_did_is_found_by_another_one(url: str, tmp_path: Path) -> None:
    done, wanted = step_in(tmp_path / "a"), step_in(tmp_path / "b")
    assert done.key == wanted.key
    assert not obtain(url, wanted)
    (done.folder / "arrays").mkdir(parents=True)
    (done.folder / "arrays" / "x.bin").write_bytes(b"\0" * 1000)
    write_record(done.folder, Record("point-1", done.key, "c", done.plain_inputs, {"url": "u"}, 1.0, "now"))
    share(url, done)
    share(url, done)  # the first stays
    assert obtain(url, wanted)
    assert wanted.record() == done.record()
    assert (wanted.folder / "arrays" / "x.bin").read_bytes() == b"\0" * 1000
    assert not obtain(url, wanted)  # it is here now


def test_a_damaged_object_of_the_shared_cache_is_no_step(url: str, tmp_path: Path) -> None:
    step, store = step_in(tmp_path / "a"), open_object_store(url)
    store.files.pipe_file(store.path(name_of(step)), b"no tar file")
    assert not obtain(url, step)
    assert step.record() is None


def test_one_at_a_time_holds_a_lease_and_a_dead_holders_is_taken_over(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLANETPOSE_LEASE_S", "2")
    monkeypatch.setattr("tasks.objectstore.lease.LOOK_EVERY_S", 0.05)
    store, waited = open_object_store(url), threading.Event()
    with leased(store, "one"), leased(store, "one"):  # a block within another one has the same
        check_lease(store, "one")
        assert store.files.exists(store.path(LEASES, "one"))
    assert not store.files.exists(store.path(LEASES, "one"))
    dead = acquired(store, f"{LEASES}/one", waited.set)
    dead._ended.set()  # renews no more
    with leased(store, "one", waited.set):
        assert waited.is_set()
        dead._ended.clear()
        dead._renewed -= 10.0
        with pytest.raises(FailedError, match="taken over by another worker"):
            dead.check()
        dead.release()  # is not his any more
        check_lease(store, "one")


def test_what_one_machine_remembers_another_one_finds(url: str, tmp_path: Path) -> None:
    from tasks.outcomes import Outcome, read_outcome, read_trace, write_outcome

    here, there = tmp_path / "here", tmp_path / "there"
    outcome = Outcome("one", "s3://b/one.img", "ok", None, "run", "now")
    trace: dict[str, Any] = {"steps": []}
    written = write_outcome(here, outcome, trace, url)
    assert pull_state(url, there) == 2
    assert read_outcome(there, "one", "s3://b/one.img") == written
    assert read_trace(there, written) == trace
    assert pull_state(url, there) == 0
    write_outcome(here, Outcome("one", "s3://b/one.img", "failed", "x: y", "run", "now"), None, url)
    assert pull_state(url, there) == 1
    (here / "images" / "one.json").unlink()
    push_files(url, here, ["images/one.json"])
    pull_state(url, there)
    assert read_outcome(there, "one", "s3://b/one.img") is None
    assert json.loads((there / "tags.json").read_text()).keys() == {"traces/one.json"}
