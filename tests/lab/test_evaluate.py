"""The evaluation: what it compares, counts and prints."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import lab.evaluate.archive as evaluate
from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.pose import Pose, write_pose_file
from flows.cli import build_app
from flows.request import Request
from flows.result import EMPTY
from lab.evaluate.archive import evaluate_archive
from lab.evaluate.summary import distribution, summary_of
from lab.evaluate.table import evaluation_table
from lab.simulate.archive import COLUMNS, MANIFEST, write_manifest
from lab.simulate.europa57 import paper_images
from tasks.point.rotation import pose_moved_by
from tasks.profile import find_profile

CAMERA = find_camera("voyager1-nac")
TRUTH = paper_images()["C1635208"].pose


def archive(folder: Path, products: tuple[str, ...]) -> Path:
    """A list of images that are not there: the corrections are made up, or refuse them."""
    folder.mkdir(exist_ok=True)
    rows = []
    for product in products:
        files = {"image": f"{product}.IMG", "pose_file": f"{product}.p.json", "truth_file": f"{product}.t.json"}
        write_pose_file(pose_moved_by(TRUTH, CAMERA, (30.0, -40.0)), folder / files["pose_file"])
        write_pose_file(TRUTH, folder / files["truth_file"])
        row: dict[str, object] = dict.fromkeys(COLUMNS, "")
        rows.append({**row, "product": product, "camera": CAMERA.name, "target": "europa", **files})
    write_manifest(folder / MANIFEST, rows)
    return folder


def made_up(shift_px: dict[str, float | None]) -> Any:
    """A corrector whose poses are wrong by so many pixels; None fails."""

    def one_result(request: Request, *_: Any, **__: Any) -> dict[str, Any]:
        shift = shift_px[request.product]
        seconds = {"point-1": 2.0}
        if shift is None:
            return EMPTY | {"status": "failed", "reason": "no-limb: because.", "seconds": seconds}
        pose = pose_moved_by(TRUTH, CAMERA, (shift, 0.0))
        uncertainty = EMPTY["uncertainty"] | {"centre_px": [1.0, 1.0], "range_factor": 1e-3}
        return EMPTY | {"status": "ok", "pose": pose.to_dict(), "uncertainty": uncertainty, "seconds": seconds}

    return one_result


@pytest.fixture
def rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    monkeypatch.setattr(evaluate, "one_result", made_up({"A": 0.5, "B": 5.0, "C": None}))
    return evaluate_archive(archive(tmp_path / "archive", ("A", "B", "C")), [find_profile("paper")], tmp_path)


def test_errors_are_corrected_minus_true(rows: list[dict[str, Any]]) -> None:
    first = rows[0]["after"]
    np.testing.assert_allclose(first["centre_px"], (0.5, 0), atol=1e-6)
    assert first["range_error"] == pytest.approx(0, abs=1e-12)
    assert first["surface_px"] == pytest.approx(0.5, rel=1e-3)
    np.testing.assert_allclose(rows[0]["sigmas"]["centre_px"], (0.5, 0), atol=1e-6)
    assert rows[0]["sigmas"]["attitude_deg"] is None
    assert rows[2]["after"] is None


def test_what_claims_to_be_right_and_is_not_is_counted_and_shown(rows: list[dict[str, Any]]) -> None:
    camera, everything = summary_of(rows)
    assert (everything["camera"], camera["camera"]) == ("all", CAMERA.name)
    counts = {key: everything[key] for key in ("images", "ok", "failed", "refused", "silently_wrong")}
    assert counts == {"images": 3, "ok": 2, "failed": 1, "refused": 0, "silently_wrong": 1}
    assert everything["reasons"] == {"no-limb": 1}
    assert everything["after"]["centre_error_px"]["median"] == pytest.approx(2.75, abs=1e-6)
    assert everything["sigmas"]["centre_px"] == {"components": 4, "within_1": 0.75, "within_2": 0.75}
    table = evaluation_table(summary_of(rows), rows)
    assert "B                SILENTLY WRONG: centre 5.00 px off" in table
    assert "C                failed, no pose: no-limb: because." in table


def test_what_simulated_images_lack_is_taken_out_of_the_stated_errors() -> None:
    from lab.evaluate.archive import not_simulated
    from lab.evaluate.assess import assess, in_sigmas
    from lab.simulate.small_world import EUROPA, small_camera, true_pose

    camera = small_camera(200.0)
    truth: Pose = true_pose(camera)
    lacking = not_simulated(find_profile("joint"), truth, camera, EUROPA)
    assert lacking["range_factor"] == pytest.approx(np.hypot(0.3 / 1560.8, 0.32 / 1560.8 / 3), rel=0.01)
    assert lacking["attitude_deg"] == EUROPA.map_frame_deg == 0.1
    assert not_simulated(find_profile("standard"), truth, camera, EUROPA) == {}
    stated = {"centre_px": [0.05, 0.04], "range_factor": 5e-4, "attitude_deg": [0.2, 0.2, lacking["attitude_deg"]]}
    found = assess(
        truth.replaced(target_from_spacecraft_km=truth.target_from_spacecraft_km * 1.0003), truth, camera, EUROPA
    )
    whole, without = in_sigmas(found, stated), in_sigmas(found, stated, lacking)
    assert whole["range_factor"] == pytest.approx([0.6], rel=0.01)
    assert without["range_factor"] == pytest.approx([3e-4 / np.sqrt(5e-4**2 - lacking["range_factor"] ** 2)], rel=0.01)
    # Nothing would be left of the last one; a fifth of it stays.
    assert in_sigmas(assess(truth, truth, camera, EUROPA), stated, lacking)["attitude_deg"] == [0, 0, 0]


def test_distributions() -> None:
    assert distribution([]) is None
    assert distribution([1.0, 2.0, 6.0]) == {"median": 2.0, "mean": 3.0, "p90": pytest.approx(5.2), "largest": 6.0}


def test_the_command_refuses_nothing_and_writes_its_figures(tmp_path: Path) -> None:
    """The images are missing, so the real chain refuses each: no step is done, none has a pose."""
    folder, out = archive(tmp_path / "archive", ("A",)), tmp_path / "out"
    done = CliRunner().invoke(build_app(), ["evaluate", str(folder), "--out", str(out), "--profile", "paper"])
    assert done.exit_code == 0, done.output
    report = json.loads((out / "evaluate.json").read_text())
    assert report["images"][0]["code"] == "image-missing"
    assert report["summary"][-1]["refused"] == 1
    (line,) = csv.DictReader((out / "evaluate.csv").open())
    assert (line["product"], line["status"], line["after_centre_error_px"]) == ("A", "refused", "")
    assert (out / "reliability-paper.png").read_bytes().startswith(b"\x89PNG")


def test_poses_of_the_steps_come_from_the_chains_records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from types import SimpleNamespace

    from tasks.registry import INGEST, POINT, POSE

    def done(kind: Any, **result: Any) -> SimpleNamespace:
        names = {"step": SimpleNamespace(kind=kind), "record": SimpleNamespace(seconds=1.0)}
        return SimpleNamespace(result=SimpleNamespace(**result), **names)

    before, after = pose_moved_by(TRUTH, CAMERA, (30.0, -40.0)), pose_moved_by(TRUTH, CAMERA, (0.3, 0.4))
    poses = {"pose": done(POSE, pose=before), "point-1": done(POINT, pose=after)}
    chain = SimpleNamespace(done={"ingest": done(INGEST), **poses})
    monkeypatch.setattr(evaluate, "one_result", made_up({"A": 0.5}))
    monkeypatch.setattr(evaluate, "replayed", lambda _: chain)
    (row,) = evaluate_archive(archive(tmp_path / "archive", ("A",)), [find_profile("paper")], tmp_path)
    found = {step: round(error["centre_error_px"], 6) for step, error in row["steps"].items()}
    assert found == {"pose": 50.0, "point-1": 0.5}
    assert row["before"] == row["steps"]["pose"]


def test_a_folder_without_a_list_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match="planetpose simulate"):
        evaluate_archive(tmp_path, [find_profile("paper")], tmp_path)
    with pytest.raises(RefusedError, match="lists none of"):
        evaluate_archive(archive(tmp_path / "archive", ("A",)), [find_profile("paper")], tmp_path, products=["Z"])
