"""An image is unchanged without its steps when all that they depend on is what it was, and never when it is not."""

import os
import time
from pathlib import Path

import pytest

from catalog.digest import SETTLED_NS
from catalog.spice import KernelLists
from flows.options import ReprocessOptions
from flows.reprocessing import fingerprint as module
from flows.reprocessing import planners
from flows.reprocessing.fingerprint import Fingerprints
from flows.reprocessing.planning import Plan, Planned
from flows.request import Request

LONG_AGO = time.time() - 10 * SETTLED_NS / 1e9


@pytest.fixture
def request_of_files(tmp_path: Path) -> Request:
    for name in ("image.png", "pose.json", "camera.toml"):
        (tmp_path / name).write_text(name)
        os.utime(tmp_path / name, (LONG_AGO, LONG_AGO))
    return Request(
        image=tmp_path / "image.png",
        pose_file=tmp_path / "pose.json",
        camera=str(tmp_path / "camera.toml"),
        target="europa",
        kernels=(),
        store=tmp_path / "out",
    )


@pytest.fixture(autouse=True)
def settled(monkeypatch: pytest.MonkeyPatch) -> None:
    """The files of a test are as old as they say: nobody can set the time of an inode."""
    monkeypatch.setattr(module, "SETTLED_NS", -1)


def digest(request: Request) -> str | None:
    return Fingerprints(KernelLists()).of(request)


@pytest.mark.parametrize("name", ["image.png", "pose.json", "camera.toml"])
def test_another_content_of_any_file_is_another_fingerprint(request_of_files: Request, name: str) -> None:
    before = digest(request_of_files)
    assert before is not None
    assert digest(request_of_files) == before
    path = request_of_files.image.parent / name
    path.write_text("other")
    os.utime(path, (LONG_AGO, LONG_AGO))  # the inode's own time shows it
    assert digest(request_of_files) != before


def test_a_label_that_appears_beside_the_image_is_seen(request_of_files: Request) -> None:
    before = digest(request_of_files)
    request_of_files.image.with_suffix(".LBL").write_text("PDS_VERSION_ID = PDS3")
    assert digest(request_of_files) != before


@pytest.mark.parametrize(
    "changes",
    [
        {"target": "io"},
        {"flip": "horizontal"},
        {"plane": 2},
        {"publish_to": "s3://bucket"},
        {"start_offset_px": (1.0, 2.0)},
    ],
)
def test_another_option_is_another_fingerprint(request_of_files: Request, changes: dict[str, object]) -> None:
    assert digest(request_of_files.model_copy(update=changes)) != digest(request_of_files)


def test_another_profile_code_or_kernel_is_another_fingerprint(
    request_of_files: Request, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    before = digest(request_of_files)
    passes = request_of_files.profile.model_copy(update={"passes": 7})
    assert digest(request_of_files.model_copy(update={"profile": passes})) != before
    kernel = tmp_path / "naif.tls"
    kernel.write_text("KPL/LSK\n")
    assert digest(request_of_files.model_copy(update={"kernels": (kernel,)})) != before
    monkeypatch.setattr(module.inputs, "verdict_version", lambda: "another")
    assert digest(request_of_files) != before


def test_where_not_all_is_seen_there_is_no_fingerprint(
    request_of_files: Request, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for changes in ({"resume": tmp_path}, {"mask": tmp_path}, {"camera": "isd:x.json"}, {"image": tmp_path / "gone"}):
        assert digest(request_of_files.model_copy(update=changes)) is None
    monkeypatch.setattr(module, "SETTLED_NS", 10**15)  # changed just now
    assert digest(request_of_files) is None


def test_a_long_list_is_planned_by_several_processes_in_its_order(
    request_of_files: Request, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(planners, "ONE_PROCESS", 3)
    monkeypatch.setattr(planners, "AT_ONCE", 2)
    monkeypatch.setattr(planners, "processors", lambda: 2)
    requests = [request_of_files.model_copy(update={"product": f"P{number}"}) for number in range(7)]
    requests[3] = requests[3].model_copy(update={"image": tmp_path / "gone.png"})
    options = ReprocessOptions(images="any", store=str(tmp_path / "out"), cache=tmp_path / "cache")
    plans = list(planners.each_plan(iter(requests), len(requests), options))
    assert [plan.request.product for plan in plans] == [f"P{number}" for number in range(7)]
    assert [plan.why for plan in plans] == ["new", "new", "new", "missing", "new", "new", "new"]


def test_counts_of_plans_need_no_plans(request_of_files: Request) -> None:
    found = Planned()
    for number in range(100):
        found.add(Plan(request_of_files, number % 2 == 0, "new", "fault: image-missing: x" if number == 0 else ""))
    assert found.in_words().startswith("50 of 100 images would be done; the files of 1 are missing")
    assert (len(found.products), found.why) == (20, {"new": 50})
