"""Which image the steps after a joint step get that left a better one."""

from pathlib import Path
from typing import Any

import pytest

from catalog.pose import POSE_KEYS
from flows.chain import Chain
from flows.image import correct_pose
from flows.profile import Profile
from flows.request import Request
from tasks.correction import IMAGE_MOVED
from tasks.record import Record
from tasks.step import Step

PROFILE = {"passes": 2, "steps": ["joint", "point"], "later": {"steps": ["joint"]}}


def corrected(folder: Path, moved: bool) -> tuple[Chain, dict[str, Any]]:
    """The chain after two joint steps that say whether they displaced the image, and where the last image is."""
    changed = {"offset_px": [0.5, 0.0], "range_factor": 1.0, "attitude_deg": [0.0, 0.0, 0.0]}
    limb = {
        "rms_px": 0.1,
        "robust_px": 0.1,
        "disagreeing": 0.0,
        "normal_rms_px": 0.1,
        "points": 99,
        "tried": 99,
        "likeness": 0.9,
    }
    results: dict[str, dict[str, Any]] = {
        "pose": {"pose": {}, "sources": dict.fromkeys(POSE_KEYS, "spice")},
        "joint": {"changed": changed, "uncertainty": {}} | ({IMAGE_MOVED: True} if moved else {}),
        "point": {"changed": changed, "uncertainty": {}},
        "validate": {"limb": limb},
    }

    def answered(step: Step) -> Record:
        return Record(step.name, step.key, step.code, step.inputs, results.get(step.kind, {}), 0.0, "now")

    request = Request(image=folder / "a.img", cache=folder, profile=Profile.model_validate(PROFILE))
    chain = Chain(request, answered)
    for name in ("pose", "undistort"):
        chain.do(name, f"tasks.{name}", {}, {})
    scene = {"observation": chain.key("undistort")}
    _, _, basemap = correct_pose(chain, scene, {"undistort": chain.folder("undistort")})
    return chain, basemap


@pytest.mark.parametrize("moved", [True, False])
def test_later_steps_get_the_displaced_image_and_its_bending_is_told_once(tmp_path: Path, moved: bool) -> None:
    chain, basemap = corrected(tmp_path, moved)
    seen = [chain.steps[name].inputs["observation"] for name in ("point-1", "joint-2", "validate")]
    bending = [chain.steps[name].inputs["settings"]["bending_px"] for name in ("joint-1", "joint-2")]
    assert bending[0] is not None
    if not moved:
        assert seen == [chain.key("undistort")] * 3
        assert bending[1] == bending[0]
        return
    assert seen[:2] == [chain.key("joint-1")] * 2
    assert chain.steps["joint-2"].places["undistort"] == chain.folder("joint-1")
    assert seen[2] == chain.key("joint-2")  # the fake one moves its image, too
    assert basemap["undistort"] == chain.folder("joint-2")
    assert bending[1] is None


@pytest.mark.parametrize("doubt", [None, "markings-do-not-match: at 2 % of the places only."])
def test_the_joint_step_is_told_when_the_markings_are_not_the_map_s(tmp_path: Path, doubt: str | None) -> None:
    from flows.image import markings_match

    evidence = {"doubt": doubt} if doubt else {}
    request = Request(image=tmp_path / "a.img", cache=tmp_path, profile=Profile.model_validate(PROFILE))
    chain = Chain(request, lambda step: Record(step.name, step.key, step.code, {}, {"evidence": evidence}, 0.0, "now"))
    assert markings_match(chain)
    chain.do("attitude-1", "tasks.attitude.step", {}, {})
    assert markings_match(chain) == (doubt is None)
