"""Reprocessing a small archive for real: what is done, what is not and why, what is remembered and reported."""

import csv
import json
import os
import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from catalog.digest import remember_digests, sha256_of_file
from flows import inputs
from flows import run as command
from flows.inputs import image_inputs
from flows.options import ReprocessOptions
from flows.progress import Silent
from flows.reprocessing.image_task import without_results
from flows.reprocessing.planning import TRIES, plans_in_words
from flows.reprocessing.run import begin, planned, sweep
from flows.request import Request
from flows.status import status_of
from lab.simulate.small_archive import LIST, POSE_FILE, PROFILE_FILE, write_small_archive
from tasks import step as step_module
from tasks.cache import prune
from tasks.changes import inputs_changed, kernels_changed, leaves_changed
from tasks.guidance.prefect_run import noted_run
from tasks.outcomes import read_outcome, read_trace, write_outcome
from tasks.record import RECORD_FILE


def nobody(_: int) -> AbstractContextManager[Silent]:
    """Tell nobody."""
    return nullcontext(Silent())


GOOD, BAD = ("small-00000", "small-00001"), "small-00002"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two good images, and one that is none."""
    folder = tmp_path_factory.mktemp("archive")
    write_small_archive(folder, 3)
    (folder / f"{BAD}.png").write_bytes(b"\x89PNG\r\n\x1a\nand nothing more")
    return folder


@pytest.fixture(scope="module")
def settings(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> ReprocessOptions:
    place = tmp_path_factory.mktemp("place")
    profile, images = str(archive / PROFILE_FILE), str(archive / LIST)
    return ReprocessOptions(
        images=images, store=str(place / "store"), cache=place / "cache", profile=profile, kernels=[], workers=1
    )


@pytest.fixture(scope="module")
def done(prefect_api: str, settings: ReprocessOptions) -> dict[str, Any]:
    """The summary of the first run."""
    return command.run_reprocess(settings, prefect_api, nobody)


def wanted(settings: ReprocessOptions, **changes: Any) -> dict[str, str]:
    """Products that would be done, and why."""
    _, plans = planned(settings.model_copy(update=changes))
    return {plan.request.product: plan.why for plan in plans if plan.do}


def test_one_bad_image_does_not_stop_the_others(done: dict[str, Any], settings: ReprocessOptions) -> None:
    assert done["status"] == {"ok": 2, "doubtful": 0, "refused": 1, "failed": 0}
    assert done["codes"] == {"image-unreadable": 1}
    assert done["too_many_failed"]
    assert all((settings.folder / name / "cube.zarr").is_dir() for name in GOOD)
    assert not (settings.folder / BAD).exists()
    assert not list(settings.folder.rglob(".*.tmp"))


def test_the_table_names_every_image_with_its_reason(done: dict[str, Any], settings: ReprocessOptions) -> None:
    rows = {row["product"]: row for row in csv.DictReader((settings.folder / "reprocess.csv").open())}
    assert set(rows) == {*GOOD, BAD}
    assert rows[BAD]["reason"].startswith("image-unreadable")
    assert {row["why"] for row in rows.values()} == {"new"}
    kept = json.loads((settings.folder / "reprocess.json").read_text())
    assert kept["run"] == done["run"]
    assert kept["steps_done"]["publish"] == 2


def test_prefect_has_a_task_per_image_and_artifacts(
    done: dict[str, Any], prefect_api: str, settings: ReprocessOptions
) -> None:
    from prefect.client.orchestration import get_client

    assert done
    with get_client(sync_client=True) as client:
        artifact = client.request("POST", "/artifacts/latest/filter", json={"limit": 200}).json()
    keys = {each["key"] for each in artifact}
    assert {"reprocess-store", "reprocess-store-overlays"} <= keys
    (overlays,) = [each["data"] for each in artifact if each["key"] == "reprocess-store-overlays"]
    assert "data:image/jpeg;base64," in overlays
    for product in (*GOOD, BAD):  # the page of `planetpose view` has the link
        run = noted_run(settings.folder, product) or {}
        assert run["url"].endswith(f"/runs/task-run/{run['task_run']}")
        assert product in run["name"]


def test_a_rerun_does_nothing_and_asks_no_server(
    done: dict[str, Any], settings: ReprocessOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert done

    def no_server(_: str) -> None:
        raise AssertionError("a server was requested")

    monkeypatch.setattr(command, "prepare", no_server)
    again = command.run_reprocess(settings, "local", nobody)
    assert (again["done"], again["unchanged"], again["status"]) == (0, 3, done["status"])


def test_what_is_refused_is_done_again_only_when_requested(done: dict[str, Any], settings: ReprocessOptions) -> None:
    assert done
    assert wanted(settings) == {}
    assert wanted(settings, again=True) == {BAD: "refused before (image-unreadable)"}
    assert set(wanted(settings, force=True)) == {*GOOD, BAD}


def test_a_changed_setting_is_named_with_both_values(
    done: dict[str, Any], settings: ReprocessOptions, archive: Path, tmp_path: Path
) -> None:
    assert done
    text = (archive / PROFILE_FILE).read_text().replace("sure_likeness = 0.4", "sure_likeness = 0.5")
    (tmp_path / PROFILE_FILE).write_text(text)
    why = wanted(settings, profile=str(tmp_path / PROFILE_FILE))
    assert why[GOOD[0]] == "changed: settings: accept.sure_likeness 0.4 -> 0.5"


def test_changed_code_of_a_step_or_of_the_verdict_is_named(
    done: dict[str, Any], settings: ReprocessOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the keys that `correct` uses: exactly what depends on the code is done again."""
    assert done
    ours = step_module.code_version
    monkeypatch.setattr(step_module, "code_version", lambda module: "new" if "point" in module else ours(module))
    assert wanted(settings) == dict.fromkeys(GOOD, "changed: code of point")
    monkeypatch.setattr(step_module, "code_version", ours)
    assert wanted(settings) == {}
    monkeypatch.setattr(inputs, "verdict_version", lambda: "another")
    assert wanted(settings) == dict.fromkeys(GOOD, "changed: code of the verdict")


def test_a_plan_needs_no_cache_of_steps(done: dict[str, Any], settings: ReprocessOptions, tmp_path: Path) -> None:
    assert done
    assert wanted(settings, cache=tmp_path / "empty") == {}


def test_a_changed_file_is_named(done: dict[str, Any], settings: ReprocessOptions, archive: Path) -> None:
    assert done
    pose, image = archive / POSE_FILE, archive / f"{GOOD[1]}.png"
    kept = pose.read_text(), image.read_bytes()
    try:
        pose.write_text(kept[0] + "\n")
        image.unlink()
        assert wanted(settings)[GOOD[0]] == "changed: pose file"
        assert wanted(settings)[GOOD[1]] == "changed: image (is gone)"
    finally:
        pose.write_text(kept[0])
        image.write_bytes(kept[1])
    assert wanted(settings) == {}


def test_a_product_that_lost_a_file_or_is_gone_is_done_again(done: dict[str, Any], settings: ReprocessOptions) -> None:
    assert done
    product = settings.folder / GOOD[0]
    overlay = (product / "overlay.png").read_bytes()
    (product / "overlay.png").write_bytes(b"")
    assert wanted(settings) == {GOOD[0]: "product is damaged: overlay.png is missing"}
    (product / "overlay.png").write_bytes(overlay[:-1])
    assert wanted(settings) == {}
    assert wanted(settings, verify=True) == {GOOD[0]: "product is damaged: overlay.png has changed since publication"}
    (product / "overlay.png").write_bytes(overlay)
    product.rename(product.with_name("elsewhere"))
    assert wanted(settings) == {GOOD[0]: "product is gone"}
    product.with_name("elsewhere").rename(product)


def test_what_may_pass_is_tried_in_the_next_runs_but_not_for_ever(
    done: dict[str, Any], settings: ReprocessOptions
) -> None:
    assert done
    known = read_outcome(settings.books, BAD, "")
    assert known is not None
    trace = read_trace(settings.books, known)
    try:
        hung = replace(known, status="failed", reason="timed-out: it hung.", passing=True)
        write_outcome(settings.books, hung, without_results(trace))
        assert wanted(settings) == {BAD: "failed before, may pass (timed-out)"}
        write_outcome(settings.books, replace(hung, tries=TRIES), without_results(trace))
        assert wanted(settings) == {}
    finally:
        write_outcome(settings.books, known, trace)


def test_status_tells_counts_runs_steps_and_what_is_out_of_date(
    done: dict[str, Any], settings: ReprocessOptions
) -> None:
    found = status_of(settings.folder)
    assert found["status"] == done["status"]
    assert found["reasons"] == {"refused": {"image-unreadable": 1}}
    assert found["runs"][-1]["run"] == done["run"]
    steps = {row["step"]: row for row in found["steps"]}
    assert steps["publish"]["done"] + steps["publish"]["cached"] == 2
    assert steps["publish"]["peak_mb"] > 10
    assert found["out_of_date"]["images"] == 0
    assert (found["stale"], found["not_remembered"]) == ([], [])


def test_a_store_is_listed_without_the_traces_of_its_images(
    done: dict[str, Any], settings: ReprocessOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a trace that is damaged, gone or of another outcome counts for nothing."""
    assert done
    known = read_outcome(settings.books, GOOD[0], "")
    assert known is not None
    small, large = (settings.books / folder / known.file_name for folder in ("images", "traces"))
    assert small.stat().st_size < 4000 < large.stat().st_size
    content = large.read_bytes()
    for damaged in (None, b"", content[:-20], content.replace(b'"key"', b'"kez"')):
        large.unlink() if damaged is None else large.write_bytes(damaged)
        assert read_trace(settings.books, known) == {}
        assert status_of(settings.folder, plan=False)["images"] == 3
    large.write_bytes(content)
    assert read_trace(settings.books, known)["steps"]
    assert wanted(settings) == {}


def test_a_product_whose_image_failed_since_is_reported_as_stale(
    done: dict[str, Any], settings: ReprocessOptions
) -> None:
    assert done
    known = read_outcome(settings.books, GOOD[0], "")
    assert known is not None
    try:
        write_outcome(settings.books, replace(known, status="failed", reason="no-limb: none."))
        assert status_of(settings.folder, plan=False)["stale"] == [GOOD[0]]
    finally:
        write_outcome(settings.books, known)


def test_an_image_whose_file_is_not_there_is_planned_as_missing_and_counted(
    settings: ReprocessOptions, archive: Path, tmp_path: Path
) -> None:
    rows = (archive / LIST).read_text().splitlines()
    (archive / "absent.csv").write_text("\n".join([*rows[:3], rows[3].replace(f"{BAD}.png", "absent.png")]) + "\n")
    absent = settings.model_copy(update={"images": str(archive / "absent.csv"), "store": str(tmp_path / "store")})
    assert wanted(absent) == dict.fromkeys(GOOD, "new") | {BAD: "missing"}
    reported = "3 of 3 images would be done; the files of 1 are missing (--fetch gets those with an address)"
    assert plans_in_words(planned(absent)[1]) == reported
    assert (
        plans_in_words(planned(settings.model_copy(update={"store": str(tmp_path)}))[1]) == reported.partition(";")[0]
    )


def test_parameters_travel_as_json_and_come_back(settings: ReprocessOptions) -> None:
    assert ReprocessOptions(**json.loads(settings.model_dump_json())) == settings
    with pytest.raises(ValidationError, match="most_failed_percent"):
        ReprocessOptions(images="europa57", store="out", most_failed_percent=101)


def test_the_cache_is_pruned_longest_unused_first_and_what_is_in_use_stays(tmp_path: Path) -> None:
    now = time.time()
    for name, days in (("aa", 30), ("ab", 20), ("ac", 10), ("ad", 0)):
        step = tmp_path / "point" / name / f"{name}cdef"
        step.mkdir(parents=True)
        (step / "arrays").write_bytes(b"x" * 1000)
        (step / RECORD_FILE).write_text("{}")
        os.utime(step / RECORD_FILE, (now, now - days * 86400))

    def left() -> list[str]:
        return sorted(path.name for path in (tmp_path / "point").glob("*/*"))

    assert prune(tmp_path) == 0
    assert prune(tmp_path, days=25) == 1002
    assert left() == ["abcdef", "accdef", "adcdef"]
    assert prune(tmp_path, limit_gb=2.1e-6) == 1002
    assert left() == ["accdef", "adcdef"]
    prune(tmp_path, limit_gb=0)
    assert left() == ["adcdef"]


def test_temporaries_of_the_dead_are_swept_everywhere(tmp_path: Path) -> None:
    import platform

    store, cache = tmp_path / "store", tmp_path / "cache"
    dead, living = (f".x~{platform.node()}~{pid}~0123456789ab.tmp" for pid in (2**22 + 1, os.getpid()))
    places = (store, store / ".reprocess" / "images", cache / "point" / "ab", cache)
    for place in places:
        for name in (dead, living):
            (place / name).mkdir(parents=True)
    sweep(store, cache)
    assert [sorted(path.name for path in place.glob(".x*")) for place in places] == [[living]] * 4


def test_digests_are_remembered_while_a_file_stays_what_it_is(tmp_path: Path) -> None:
    file, book = tmp_path / "kernel.bsp", tmp_path / "digests.json"
    file.write_bytes(b"one")
    stat = file.stat()
    signature = [stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino]
    book.write_text(json.dumps({str(file.resolve()): [signature, "as remembered"]}))
    remember_digests(book)
    assert sha256_of_file(file) == "as remembered"
    file.write_bytes(b"two")
    assert sha256_of_file(file) != "as remembered"
    book.write_text("no JSON")
    remember_digests(book)


def test_changes_name_kernels_and_settings() -> None:
    old, new = [["a.tls", "1"], ["b.bsp", "2"]], [["a.tls", "3"], ["c.bsp", "4"]]
    found = inputs_changed({"kernels": "kernels", "pose_file": "pose file"}, {"kernels": old}, {"kernels": new})
    assert found == ["kernel a.tls", "kernel c.bsp (new)", "kernel b.bsp (gone)"]
    assert inputs_changed({"kernels": "kernels"}, {"kernels": old}, {"kernels": old}) == []
    assert kernels_changed(old, old[::-1]) == ["kernels: their order"]
    assert leaves_changed({"n": {"m": 1, "k": 0}}, {"n": {"m": 2, "k": 0}}) == ["n.m 1 -> 2"]


def test_a_detached_label_counts_by_its_content(tmp_path: Path) -> None:
    image, label = tmp_path / "C1.IMG", tmp_path / "C1.LBL"
    image.write_bytes(b"pixels")

    def counted() -> str | None:
        return image_inputs(Request(image=image, kernels=())).label

    assert counted() is None
    label.write_text("one")
    before = counted()
    label.write_text("two and more")
    assert None not in (before, counted())
    assert counted() != before


def test_what_the_list_names_is_fetched_first_and_what_cannot_be_had_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    mirrored = tmp_path / "mirror" / "pds-rings" / "volumes" / "there.png"
    mirrored.parent.mkdir(parents=True)
    mirrored.write_bytes(b"pixels")
    (tmp_path / LIST).write_text("product,image\nA,pds-rings:volumes/there.png\nB,pds-rings:volumes/gone.png\n")
    monkeypatch.setenv("PLANETPOSE_MIRROR", str(tmp_path / "mirror"))
    place = {"store": str(tmp_path / "store"), "cache": tmp_path / "cache", "archive": tmp_path / "archive"}
    run = begin(ReprocessOptions(images=str(tmp_path / LIST), fetch=True, **place))
    assert [request.image.exists() for request in run.requests] == [True, False]
    assert "gone.png was not fetched" in caplog.text


def test_parts_of_a_list_are_planned_alone_and_together_are_the_list(settings: ReprocessOptions) -> None:
    found = [
        {plan.request.product for plan in planned(settings.model_copy(update={"part": f"{number}/2"}))[1]}
        for number in (1, 2)
    ]
    assert found[0] | found[1] == {*GOOD, BAD}
    assert not found[0] & found[1]
    with pytest.raises(ValidationError, match="2/4"):
        ReprocessOptions(images="list", part="3/2")
