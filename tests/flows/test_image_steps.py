"""What the steps of an image are given, and what is done where a corrected pose is doubted."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy.io import fits

from catalog.camera import find_camera
from catalog.pose import POSE_KEYS, Pose
from catalog.target import find_target
from flows.chain import Chain
from flows.image import Corrected, corrected_or_explained
from flows.one_image import one_result
from flows.progress import Silent
from flows.request import Request
from flows.verdict import doubts
from tasks.accept.rest import at_rest
from tasks.accept.settings import StillSettings
from tasks.correcting import CorrectionResult, Known
from tasks.diagnose.step import Cause, DiagnoseResult
from tasks.profile import Profile
from tasks.record import Record
from tasks.registry import ATTITUDE, DIAGNOSE, JOINT
from tasks.scene_inputs import UNIFORM, SceneFiles, SceneInputs
from tasks.simulate import SceneSettings
from tasks.step import AnyStep, run
from tasks.validate.limb import LimbFigures
from tasks.validate.step import OrientationReport, Similarity, ValidateResult
from tasks.validate.sun import SunReport

POSE = Pose(0.0, np.eye(3), np.array([0.0, 0.0, 7.8e5]), np.array([-4e8, 1e8, -5e8]), np.eye(3))
LIMB = LimbFigures(
    rms_px=0.1, mean_px=(0.0, 0.0), normal_rms_px=0.1, normal_median_px=0.0, robust_px=0.1, disagreeing=0.0, blur=1.0,
    psf_sigma_px=0.8, points=99, tried=99, similarity=0.9, correlation=0.9, likeness=0.9,
)  # fmt: skip
REPORT = ValidateResult(
    limb=LIMB,
    similarity=Similarity(before=0.5, after=0.9),
    sun=SunReport(),
    blocks=None,
    dark_limb={},
    orientation=OrientationReport(verdict="matched", sigmas=20.0),
    symmetry=None,
    doubt=None,
)


def chain_of(folder: Path, steps: list[str], later: list[str], kind: Any = JOINT, **reported: Any) -> Chain:
    """The chain after two passes whose corrections all say the same; those of a kind also say what `reported` does."""
    changed = {"offset_px": [0.5, 0.0], "range_factor": 1.0, "attitude_deg": [0.0, 0.0, 0.0]}

    def answered(step: AnyStep) -> Record:
        if step.kind.name == "validate":
            result: Any = REPORT
        elif step.kind is DIAGNOSE:
            cause = Cause(code="image-mirrored", fault="it is mirrored.", remedy="Give --flip x.")
            result = DiagnoseResult(diagnosis=cause, evidence={})
        else:
            own = reported if step.kind is kind else {}
            result = CorrectionResult(pose=step.inputs.pose, changed=changed, **own)
        return Record(step.name, step.key, step.code, {}, result.model_dump(mode="json"), 0.0, "now")

    profile = Profile.model_validate({"passes": 2, "steps": steps, "later": {"steps": later}})
    chain = Chain(Request(image=folder / "a.img", cache=folder, profile=profile), answered)
    scene = SceneInputs(
        observation="key of undistort",
        camera=find_camera("galileo-ssi"),
        target=find_target("europa"),
        basemap=UNIFORM,
        simulate=SceneSettings(),
    )
    known = Known(scene, POSE, POSE, dict.fromkeys(POSE_KEYS, "spice"), 0.3)
    corrected_or_explained(chain, Corrected(known, SceneFiles(folder, None)))
    return chain


@pytest.mark.parametrize("moved", [True, False])
def test_later_steps_get_the_displaced_image_and_are_reported_of_it(tmp_path: Path, moved: bool) -> None:
    chain = chain_of(tmp_path, ["joint", "point"], ["joint"], image_moved=moved)
    steps = {name: done.step for name, done in chain.done.items()}
    seen = {name: step.inputs.scene.observation for name, step in steps.items()}
    folders = {name: step.files.image for name, step in steps.items()}
    assert seen["joint-1"] == "key of undistort"
    assert not steps["joint-1"].inputs.image_moved
    if not moved:
        assert set(seen.values()) == {"key of undistort"}
        assert not steps["joint-2"].inputs.image_moved
        return
    first, second = steps["joint-1"], steps["joint-2"]
    assert (seen["point-1"], seen["joint-2"], seen["validate"]) == (first.key, first.key, second.key)
    assert (folders["joint-2"], folders["validate"]) == (first.folder, second.folder)
    assert second.inputs.image_moved


@pytest.mark.parametrize("match", [None, True, False])
def test_the_joint_step_is_reported_when_the_markings_are_not_the_map_s(tmp_path: Path, match: bool | None) -> None:
    chain = chain_of(tmp_path, ["attitude", "joint"], ["joint"], ATTITUDE, markings_match=match)
    assert chain.done["joint-1"].step.inputs.markings_match == (match is not False)


def test_only_the_first_pass_searches_the_frame(tmp_path: Path) -> None:
    chain = chain_of(tmp_path, ["point"], ["point"])
    assert [chain.done[f"point-{number}"].step.inputs.search_frame for number in (1, 2)] == [True, False]


CAUSE = "image-mirrored: it is mirrored. Give --flip x."
FOLLOWS, OTHER = "joint-not-settled: it moves. Check.", "range-conflict: it is 5 sigma. Check."


@pytest.mark.parametrize(
    ("said", "reported"),
    [(None, []), (FOLLOWS, [CAUSE, FOLLOWS]), (OTHER, [OTHER])],
)
def test_the_cause_is_looked_for_where_a_doubt_may_follow_from_another_fault(
    tmp_path: Path, said: str | None, reported: list[str]
) -> None:
    chain = chain_of(tmp_path, ["joint"], ["joint"], evidence={"doubt": said})
    assert doubts(chain) == reported
    assert ("diagnose" in chain.done) == (said == FOLLOWS)


def test_a_move_from_behind_the_camera_has_no_pixels_and_is_not_at_rest() -> None:
    moved = CorrectionResult(pose=POSE, changed={"offset_px": [float("nan"), float("nan")]}, uncertainty={})
    assert moved.model_dump(mode="json")["changed"] == {"offset_px": [None, None]}
    assert not at_rest([moved], StillSettings())


def test_a_scan_s_refusal_does_not_ask_for_a_camera_that_cannot_help(tmp_path: Path) -> None:
    """As New Horizons' MVIC takes its colour pictures."""
    header = fits.Header({"HOSTNAME": "NEW HORIZONS", "INSTRU": "mvi", "SCANTYPE": "TDI", "TARGET": "IO"})
    fits.writeto(tmp_path / "mc1.fits", np.ones((20, 30), np.float32), header)
    request = Request(image=tmp_path / "mc1.fits", store=tmp_path / "store", cache=tmp_path / "cache")
    result = one_result(request, Silent(), run_step=run)
    assert result["status"] == "refused"
    assert "SCANTYPE = TDI" in result["reason"]
    assert "Give --camera" not in result["reason"]
    assert "line-scan" in result["reason"]
