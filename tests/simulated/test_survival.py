"""Frames that hold no answer, or half of one, against every registration and both profiles' corrections: a reason or
the right answer, never a wrong one.

Frame and disk are small, so that the whole matrix takes seconds.
"""

import numpy as np
import pytest

from catalog.errors import PlanetposeError
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from lab.simulate.plant import planted, pose_error
from lab.simulate.small_world import EUROPA, clean_image, observed, scene_of, small_camera, true_pose
from tasks.accept.acceptance import check_limb, doubtful_likeness
from tasks.attitude import AttitudeSettings, find_attitude
from tasks.point import PointSettings, find_pointing
from tasks.point.registration import REGISTRATIONS
from tasks.profile import find_profile
from tasks.range import RangeSettings, find_range
from tasks.roll import RollSettings, find_roll
from tasks.simulate import Scene
from tasks.validate import validate_limb

CAMERA = small_camera(diameter_px=64, size_px=(104, 96)).model_copy(update={"centre_px": (50.3, 46.6)})
SCENE = scene_of(CAMERA, oversample=3)
RIGHT_PX = 1.0
CORRECTORS = {
    "point": (find_pointing, PointSettings),
    "roll": (find_roll, RollSettings),
    "range": (find_range, RangeSettings),
    "attitude": (find_attitude, AttitudeSettings),
}


def unflagged(image: np.ndarray) -> Observation:
    """The image as it is, nothing flagged."""
    noise = np.ones(image.shape, np.float32)
    return Observation(image.astype(np.float32), noise, np.zeros(image.shape, np.uint16))


@pytest.fixture(scope="module")
def frames() -> dict[str, tuple[Observation, Pose]]:
    """Frames by name, each with the true pose (or with the one that somebody might claim)."""
    truth = true_pose(CAMERA)
    clean = clean_image(SCENE, truth)
    y, x = np.mgrid[: clean.shape[0], : clean.shape[1]].astype(np.float32)
    half, crescent = true_pose(CAMERA, (2.4, 47.1)), true_pose(CAMERA, phase_deg=130.0)
    empty = observed(np.full_like(clean, 6.0))
    flat = np.zeros_like(clean)
    lost = Observation(flat * np.nan, flat + 1, np.full(clean.shape, int(Quality.MISSING), np.uint16))
    return {
        "whole disk": (observed(clean), truth),
        "no target": (empty, truth),
        "half out of frame": (observed(clean_image(SCENE, half)), half),
        "crescent of phase 130": (observed(clean_image(SCENE, crescent)), crescent),
        "saturated": (unflagged(np.minimum(clean, 60.0)), truth),
        "all zero": (unflagged(flat), truth),
        "all NaN": (lost, truth),
        "NaN that nobody flagged": (unflagged(flat * np.nan), truth),
        "inverted": (observed(clean.max() - clean), truth),
        "gradient": (observed(2 * x + y), truth),
    }


FRAMES = [
    "whole disk", "no target", "half out of frame", "crescent of phase 130", "saturated", "all zero", "all NaN",
    "NaN that nobody flagged", "inverted", "gradient",
]  # fmt: skip
HOPELESS = {"no target", "saturated", "all zero", "all NaN", "NaN that nobody flagged", "inverted", "gradient"}


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("name", sorted(REGISTRATIONS))
def test_every_registration_has_a_reason_or_the_right_offset(name: str, frame: str, frames) -> None:
    observation, truth = frames[frame]
    wrong = planted(truth, CAMERA, (2.3, -1.6), 1, (0, 0, 0))
    reason = None
    try:
        found = find_pointing(observation, wrong, SCENE, PointSettings(registration=name, diameter_px=80))
    except PlanetposeError as error:
        reason = error.reason
    if reason:
        print(f"{name}, {frame}: {reason}")
        assert frame != "whole disk"
        assert len(reason) > 40  # code, fault, remedy
        return
    left = np.hypot(*pose_error(found.pose, truth, CAMERA, EUROPA).centre_px)
    print(f"{name}, {frame}: {left:.3f} px left")
    assert frame not in HOPELESS
    assert left <= RIGHT_PX


@pytest.mark.parametrize("name", sorted(REGISTRATIONS))
def test_every_registration_says_how_sure_it_is_and_how_long_it_took(name: str, frames) -> None:
    from tasks.compare.match import match_scene

    observation, truth = frames["whole disk"]
    shift = REGISTRATIONS[name](match_scene(observation, SCENE, planted(truth, CAMERA, (0.4, -0.3), 1, (0, 0, 0))))
    assert shift.offset_px.shape == (2,)
    assert shift.iterations >= 1
    assert 0.9 < shift.quality <= 1 + 1e-6
    if shift.covariance is not None:
        assert shift.covariance.shape == (2, 2)
        assert (np.linalg.eigvalsh(shift.covariance) > 0).all()


def passes(observation: Observation, pose: Pose, name: str) -> tuple[Pose, str]:
    """Both passes of a profile as the flow runs them, with its verdict. Raises what the steps raise."""
    profile = find_profile(name)
    scene = Scene(CAMERA, EUROPA, SCENE.basemap, profile.simulate.model_copy(update={"oversample": 3}))
    for number in (1, 2):
        for step in profile.corrections(number):
            corrector, model = CORRECTORS[step]
            settings = profile.settings_of(step, number).model_dump()
            if step == "point" and number > 1:
                settings["coarse"] = False
            if "ssim" in settings:
                settings["ssim"]["step"] = 0.0025
            pose = corrector(observation, pose, scene, model.model_validate(settings)).pose
    limb = validate_limb(observation, pose, scene).figures()
    check_limb(profile.accept, limb)
    return pose, "doubtful" if doubtful_likeness(profile.accept, limb) else "ok"


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("profile", ["paper", "standard"])
def test_a_profile_has_a_reason_or_the_right_answer(profile: str, frame: str, frames) -> None:
    observation, truth = frames[frame]
    reason = None
    try:
        pose, status = passes(observation, planted(truth, CAMERA, (4.3, -3.6), 1.002, (0, 0, 0)), profile)
    except PlanetposeError as error:
        reason = error.reason
    if reason:
        print(f"{profile}, {frame}: {reason}")
        assert frame != "whole disk"
        return
    left = pose_error(pose, truth, CAMERA, EUROPA)
    print(f"{profile}, {frame}: {status}, centre {np.hypot(*left.centre_px):.3f} px, surface {left.surface_px:.3f} px")
    if status == "ok":
        assert frame not in HOPELESS
        assert np.hypot(*left.centre_px) <= RIGHT_PX
        assert left.surface_px <= RIGHT_PX
