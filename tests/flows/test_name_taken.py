"""Two images of one name never take each other's place; the same image may change, move, and be done again."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from catalog.errors import RefusedError
from flows.cli import build_app
from flows.one_image import answer_from_cache, one_result
from flows.options import ReprocessOptions
from flows.progress import Silent
from flows.reprocessing.image_task import job_of, outcome_of
from flows.reprocessing.planning import Plan, plan_of
from flows.reprocessing.run import Run, Tally
from flows.reprocessing.worker import do
from flows.requests import requests_of_list
from flows.status import status_of
from lab.fuzz.batch import Ground
from lab.simulate.small_archive import CAMERA_FILE, POSE_FILE, PROFILE_FILE
from tasks.outcomes import all_outcomes, write_outcome
from tasks.publish.origin import OTHER_IMAGE, origin_of, refuse_taken
from tasks.step import AnyStep, run

PUBLISHED = ("ok", "doubtful")


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> Ground:
    made = Ground(tmp_path_factory.mktemp("ground"))
    made.prepare()
    return made


@pytest.fixture
def raw(ground: Ground, tmp_path: Path) -> Path:
    """frame.png of one folder, and another image of that name in the folder `calibrated` beside it."""
    first, second = ground.images()
    for folder, image in (("raw", first), ("calibrated", second)):
        (tmp_path / folder).mkdir()
        shutil.copy(image, tmp_path / folder / "frame.png")
    return tmp_path / "raw" / "frame.png"


def other_than(image: Path) -> Path:
    return image.parents[1] / "calibrated" / image.name


def corrected(ground: Ground, image: Path, store: Path, **options: Any) -> dict[str, Any]:
    request = ground.request(image, store, **options)
    return answer_from_cache(request) or one_result(request, Silent(), run_step=run)


def test_the_second_image_of_a_name_is_refused_naming_both_and_can_have_another_name(
    ground: Ground, raw: Path, tmp_path: Path
) -> None:
    store, other = tmp_path / "store", other_than(raw)
    assert corrected(ground, raw, store)["status"] in PUBLISHED
    before = (store / "frame/result.json").read_bytes()
    for _ in range(2):
        refused = corrected(ground, other, store)
        assert refused["status"] == "refused"
        assert refused["reason"].startswith(f"{OTHER_IMAGE}: ")
        assert all(part in refused["reason"] for part in (str(raw), str(other), "--product"))
        assert (refused["image"], refused["cube"]) == (str(other), None)
    assert (store / "frame/result.json").read_bytes() == before
    assert corrected(ground, other, store, product="frame_calibrated")["status"] in PUBLISHED
    assert corrected(ground, raw, store)["status"] in PUBLISHED
    shutil.rmtree(store / "frame")  # the last remedy
    assert corrected(ground, other, store)["status"] in PUBLISHED


def test_an_image_that_changes_or_moves_keeps_its_place(ground: Ground, raw: Path, tmp_path: Path) -> None:
    store, second = tmp_path / "store", ground.images()[1]
    assert corrected(ground, raw, store)["status"] in PUBLISHED
    shutil.copy(second, raw)  # a new version of the file
    assert corrected(ground, raw, store)["status"] in PUBLISHED
    moved = tmp_path / "moved" / "frame.png"
    moved.parent.mkdir()
    raw.rename(moved)
    assert corrected(ground, moved, store)["status"] in PUBLISHED
    shutil.copy(ground.images()[0], moved)  # moved, seen there, and changed later
    assert corrected(ground, moved, store)["status"] in PUBLISHED
    link = tmp_path / "link"
    link.symlink_to(moved.parent)
    shutil.copy(second, moved)  # the same place by another way
    assert corrected(ground, link / "frame.png", store)["status"] in PUBLISHED
    origin = origin_of(store / "frame")
    assert origin
    assert {str(raw), str(moved), str(link / "frame.png")} == set(origin.paths)


def test_of_two_at_the_same_time_the_second_to_be_published_is_refused(
    ground: Ground, raw: Path, tmp_path: Path
) -> None:
    store = tmp_path / "store"

    def run_step(step: AnyStep, progress: Any) -> Any:
        if step.name == "publish":  # now the other command is done, whose image had the name too
            assert corrected(ground, other_than(raw), store)["status"] in PUBLISHED
        return run(step, progress)

    first = one_result(ground.request(raw, store), Silent(), run_step=run_step)
    assert (first["status"], first["reason"].partition(":")[0]) == ("refused", OTHER_IMAGE)
    assert origin_of(store / "frame").paths == (str(other_than(raw)),)  # type: ignore[union-attr]
    assert [path.name for path in store.glob(".*.tmp")] == []


@pytest.mark.parametrize("thing", ["a folder of the user's", "a file"])
def test_what_is_no_product_is_never_replaced(ground: Ground, raw: Path, tmp_path: Path, thing: str) -> None:
    place = raw.parent / "frame"  # as with --store beside the images
    if thing == "a file":
        place.write_text("mine")
    else:
        place.mkdir()
        (place / "notes.txt").write_text("mine")
    refused = corrected(ground, raw, raw.parent)
    assert refused["reason"].startswith("product-place-taken: ")
    assert str(place) in refused["reason"]
    assert (place if thing == "a file" else place / "notes.txt").read_text() == "mine"


def test_an_empty_or_damaged_product_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "frame").mkdir()
    refuse_taken(tmp_path / "frame", tmp_path / "a.png", "1" * 64)
    (tmp_path / "frame/record.json").write_text("half of i")
    refuse_taken(tmp_path / "frame", tmp_path / "a.png", "1" * 64)


def test_a_product_without_a_record_is_known_by_its_cube(tmp_path: Path) -> None:
    head = tmp_path / "frame/cube.zarr/zarr.json"
    head.parent.mkdir(parents=True)
    head.write_text(json.dumps({"attributes": {"provenance": json.dumps({"image": {"sha256": "2" * 64}})}}))
    refuse_taken(tmp_path / "frame", tmp_path / "a.png", "2" * 64)
    with pytest.raises(RefusedError, match="the product of another image"):
        refuse_taken(tmp_path / "frame", tmp_path / "a.png", "1" * 64)


@pytest.fixture
def lists(ground: Ground, raw: Path, tmp_path: Path) -> list[ReprocessOptions]:
    """Reprocessing of two lists that name two images alike, into one store."""
    made = []
    for image in (raw, other_than(raw)):
        for name in (CAMERA_FILE, POSE_FILE):
            shutil.copy(ground.archive / name, image.parent / name)
        table = image.parent / "list.csv"
        table.write_text(f"image,camera,target,pose_file\nframe.png,{CAMERA_FILE},europa,{POSE_FILE}\n")
        profile = str(ground.archive / PROFILE_FILE)
        cache = ground.folder / "cache"
        made.append(
            ReprocessOptions(images=str(table), store=str(tmp_path / "store"), profile=profile, kernels=(), cache=cache)
        )
    return made


def planned(settings: ReprocessOptions) -> Plan:
    (request,) = requests_of_list(settings)
    return plan_of(request, settings)


def reprocessed(settings: ReprocessOptions) -> Plan:
    """As the flow does it, in this process."""
    plan = planned(settings)
    said: list[dict[str, Any]] = []
    if plan.do:
        do(plan.request, lambda kind, **content: said.append({"kind": kind, **content}))
        end = said[-1]
        write_outcome(settings.books, outcome_of(job_of(plan, settings, "run"), end), end["trace"])
    else:
        Run(settings, "run", [plan.request], Tally(1)).leave(plan)
    return plan


def test_lists_with_one_name_for_two_images_keep_both_outcomes(lists: list[ReprocessOptions], tmp_path: Path) -> None:
    first, second = lists
    assert reprocessed(first).why == "new"
    before = (first.folder / "frame/result.json").read_bytes()
    assert reprocessed(second).why.startswith("its name is taken: ")
    assert (first.folder / "frame/result.json").read_bytes() == before
    for _ in range(2):
        assert (reprocessed(first).why, reprocessed(second).why) == ("unchanged (ok)", "unchanged (refused)")
    outcomes = {outcome.status: outcome for outcome in all_outcomes(first.books)}
    assert outcomes["refused"].code == OTHER_IMAGE
    assert outcomes["ok"].image == str(tmp_path / "raw/frame.png")
    status = status_of(first.folder, plan=False)
    assert (status["images"], status["stale"], status["not_remembered"]) == (2, [], [])
    shutil.rmtree(first.folder / "frame")
    assert reprocessed(second).why == "its name is free now"
    assert [outcome.image for outcome in all_outcomes(first.books)] == [str(tmp_path / "calibrated/frame.png")]


def test_a_list_may_move_and_its_images_change_later(
    lists: list[ReprocessOptions], ground: Ground, tmp_path: Path
) -> None:
    first = lists[0]
    reprocessed(first)
    (tmp_path / "raw").rename(tmp_path / "elsewhere")
    moved = first.model_copy(update={"images": str(tmp_path / "elsewhere/list.csv")})
    assert reprocessed(moved).why == "unchanged (ok)"
    shutil.copy(ground.images()[1], tmp_path / "elsewhere/frame.png")
    assert reprocessed(moved).why == "changed: image"
    assert reprocessed(moved).why == "unchanged (ok)"


@pytest.mark.parametrize(
    ("names", "reported"),
    [(["a"], "1 names for 2 files"), (["a", "../b"], "no name for a folder"), (["a", "index.parquet"], "no name")],
)
def test_names_of_products_that_do_not_fit_are_wrong_usage(names: list[str], reported: str, raw: Path) -> None:
    given = [part for name in names for part in ("--product", name)]
    done = CliRunner().invoke(build_app(), ["correct", str(raw), str(other_than(raw)), *given], env={"COLUMNS": "300"})
    assert done.exit_code == 2
    assert reported in done.output


def test_names_that_are_no_text_are_refused_alone_and_shown(ground: Ground, raw: Path, tmp_path: Path) -> None:
    image = raw.with_name(os.fsdecode(b"bad-\xff.png"))
    shutil.copy(raw, image)
    result = corrected(ground, image, tmp_path / "store")
    assert result["reason"].startswith("name-not-text: ")
    assert "bad-\\xff.png" in result["reason"]
    assert result["image"].endswith("bad-\\xff.png")
    json.dumps(result, ensure_ascii=False).encode()
    for option in ("pose_file", "mask", "basemap", "shape", "resume"):
        refused = corrected(ground, raw, tmp_path / "store", **{option: image})
        assert refused["reason"].startswith("name-not-text: "), option
