"""Images that cannot be corrected name the planted cause, and leave what it takes to understand them."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hostile import CAMERA, Hostile, beside, corrected, is_reported, off_px, scenes, wrong
from ray_caster import exposed, pose_of, rendered

from catalog.basemap import map_of_target, uniform_map
from catalog.errors import FailedError
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.readers.noise import measured_noise
from catalog.reasons import Reason
from catalog.target import find_target
from tasks.diagnose import DiagnoseSettings, trials, tried
from tasks.diagnose.candidates import Candidate
from tasks.diagnose.choice import diagnosis_of, incomplete_frame
from tasks.diagnose.others import without_others
from tasks.simulate import Scene, SceneSettings
from tasks.simulate.suns import sun_azimuth_deg, with_sun

EUROPA = find_target("europa")
VIEW: dict[str, Any] = {"above_deg": (250, 5), "sun_deg": (290, 3), "roll_deg": 20}
TRUTH = pose_of(CAMERA, EUROPA.mean_radius_km, 50.0, (120.0, 133.0), **VIEW)
SETTINGS = DiagnoseSettings()


@cache
def all_scenes() -> tuple[Hostile, ...]:
    return tuple(scenes(views=(0,)))


def chosen(*names: str) -> list[Hostile]:
    return [scene for scene in all_scenes() if scene.name in names]


def scene_of(hostile: Hostile, mapped: bool = True) -> Scene:
    target = find_target(hostile.target)
    basemap = map_of_target(target) if mapped else uniform_map()
    return Scene(hostile.camera, target, basemap, SceneSettings(photometry="mixture", oversample=2))


def observed(image: np.ndarray) -> Observation:
    missing = ~np.isfinite(image)
    filled = np.where(missing, 0, image).astype(np.float32)
    quality = np.where(missing, np.uint16(Quality.MISSING), np.uint16(0))
    return Observation(filled, measured_noise(filled, ~missing, False), quality)


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("range-0.8-0", "disk-size"),
        ("focal-0.5-0", "summing-mode"),
        ("sun-80-0", "sun-direction"),
        ("mirrored-0", "image-mirrored"),
        ("negative-0", "image-inverted"),
    ],
)
def test_what_explains_a_hostile_image_is_the_cause_that_was_planted(name: str, code: str) -> None:
    (hostile,) = chosen(name)
    scene, observation = scene_of(hostile), observed(hostile.image)
    seen = tried(observation, hostile.pose, scene, SETTINGS)
    diagnosis = diagnosis_of(seen, hostile.pose, scene, SETTINGS)
    print([(e.candidate.name, round(e.likeness, 3), e.limb_px, e.size) for e in seen.found], diagnosis)
    assert diagnosis is not None
    assert diagnosis.code == code
    assert diagnosis.fault.endswith(".")
    assert diagnosis.remedy


def test_noise_alone_is_explained_by_nothing() -> None:
    (hostile,) = chosen("noise-0")
    found = tried(observed(hostile.image), hostile.pose, scene_of(hostile), SETTINGS)
    assert diagnosis_of(found, hostile.pose, scene_of(hostile), SETTINGS) is None


def test_a_frame_that_is_mostly_missing_is_reported_so() -> None:
    (hostile,) = chosen("truncated-0")
    scene = scene_of(hostile)
    cause = incomplete_frame(observed(hostile.image), scene, SETTINGS)
    assert cause is not None
    assert cause.code == "frame-incomplete"
    assert cause.fault.startswith("61% of the frame's pixels are missing")
    assert incomplete_frame(observed(np.ones((256, 256))), scene, SETTINGS) is None


@pytest.mark.parametrize("code", [Reason.NO_USABLE_PIXELS, Reason.INTERRUPTED])
def test_an_explanation_that_lies_on_no_values_is_left_out_and_ends_nothing(
    code: Reason, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise FailedError(code, "nothing to see.", "")

    (hostile,) = chosen("truncated-0")
    observation, scene = observed(hostile.image), scene_of(hostile)
    predicted = Candidate("as-predicted", 1.0, observation, hostile.pose)
    monkeypatch.setattr(trials, "families", lambda *_: [[predicted]])
    monkeypatch.setattr(trials, "refined", fails)
    if code == Reason.NO_USABLE_PIXELS:
        assert tried(observation, hostile.pose, scene, SETTINGS).found == []
    else:
        with pytest.raises(FailedError, match="nothing to see"):
            tried(observation, hostile.pose, scene, SETTINGS)


@pytest.mark.parametrize("azimuth_deg", [0.0, 77.0, 181.0, 300.0])
@pytest.mark.parametrize("phase_deg", [10.0, 60.0, 130.0])
def test_a_sun_is_where_it_was_put(azimuth_deg: float, phase_deg: float) -> None:
    pose = with_sun(TRUTH, azimuth_deg, phase_deg)
    assert pose.phase_deg == pytest.approx(phase_deg, abs=1e-6)
    assert (sun_azimuth_deg(pose) - azimuth_deg + 180) % 360 - 180 == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("gap_px", [6.0, 20.0])
def test_a_planet_beside_its_moon_is_masked_and_the_moon_is_not(gap_px: float) -> None:
    image = exposed(rendered(TRUTH, CAMERA, beside(TRUTH, gap_px)), 1)
    hostile = Hostile("two", "other body", image, wrong(TRUTH))
    others = without_others(observed(image), hostile.pose, scene_of(hostile))
    assert others is not None
    y, x = np.mgrid[:256, :256]
    away = np.hypot(x - 120.0, y - 133.0)
    planet = np.hypot(x - (120.0 - 270.0 - gap_px), y - 133.0) < 219
    lit = image > 200
    print(others.centre_px, others.across_px)
    assert (others.pixels & planet & lit).sum() > 0.95 * (planet & lit).sum()
    assert not (others.pixels & (away < 51)).any()
    assert (
        without_others(observed(exposed(rendered(TRUTH, CAMERA, beside(TRUTH)[:1]))), TRUTH, scene_of(hostile)) is None
    )


@pytest.fixture(scope="module")
def failed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Hostile, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("hostile")
    (hostile,) = chosen("range-1.2-0")
    return folder, hostile, corrected(hostile, folder)


def test_a_failed_image_leaves_picture_and_what_was_tried_and_no_product(failed) -> None:
    folder, hostile, result = failed
    print(result["reason"])
    assert result["status"] == "failed"
    assert is_reported(hostile, result)
    assert result["overlay"] == f"{folder}/out/.failed/{hostile.name}/overlay.png"
    assert Path(result["overlay"]).read_bytes().startswith(b"\x89PNG")
    tried_json = json.loads(Path(result["tried"]).read_text())
    assert {each["tried"] for each in tried_json["explanations"]} >= {"as-predicted", "size"}
    best = Pose.from_dict(tried_json["best_pose"])
    assert CAMERA.project(best.target_in_camera_km) == pytest.approx((120.0, 133.0), abs=0.5)
    assert [path.name for path in (folder / "out").iterdir()] == [".failed"]


def test_what_was_left_goes_when_the_image_is_solved(failed) -> None:
    folder, hostile, result = failed
    solved = corrected(Hostile(hostile.name, "size", hostile.image, wrong(TRUTH), truth=TRUTH), folder)
    assert solved["status"] in ("ok", "doubtful")
    assert (solved["tried"], Path(result["tried"]).exists()) == (None, False)
    away = off_px(Hostile("", "size", hostile.image, TRUTH, truth=TRUTH), solved)
    assert away is not None
    assert away < 0.1


def test_map_none_takes_a_body_without_markings(tmp_path: Path) -> None:
    (hostile,) = chosen("clouds-0")
    result = corrected(hostile, tmp_path, basemap=Path("none"))
    print(result["status"], result["reason"], off_px(hostile, result))
    assert result["status"] in ("ok", "doubtful")
    assert result["attitude_deg"] is None
    away = off_px(hostile, result)
    assert away is not None
    assert away < 0.5
