"""The camera's roll by the limb of another body of the frame, drawn by the independent ray caster."""

from dataclasses import dataclass

import numpy as np
import pytest
from astropy.io import fits

from catalog.basemap import map_of_target
from catalog.camera import find_camera
from catalog.given_bodies import bodies_given
from catalog.observation import Observation
from catalog.pose import Pose, read_pose_file
from catalog.readers.noise import measured_noise
from catalog.target import find_target
from lab.bodies.picture import write_scene
from lab.bodies.scenes import scene_of
from tasks.correcting import CorrectionResult
from tasks.joint.parameters import rolled
from tasks.joint.roll_by_others import roll_by_others
from tasks.priors import PriorSettings
from tasks.publish.step import roll_by
from tasks.simulate import Scene, SceneSettings

PRIORS = PriorSettings(range_km=None, range_share=0.001, roll_deg=0.2)


@dataclass(frozen=True)
class Frame:
    """A moon at the limb of Jupiter, and its true pose."""

    observation: Observation
    scene: Scene
    pose: Pose


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> Frame:
    made = scene_of("straddling", 0)
    files = write_scene(made, tmp_path_factory.mktemp("roll"))
    image, target = fits.getdata(files.image).astype(np.float32), find_target(made.target)
    observation = Observation(
        image, measured_noise(image, np.ones(image.shape, bool), False), np.zeros(image.shape, np.uint16)
    )
    pose = Pose(2e8, made.camera_from_j2000, made.target_km, made.sun_km, made.body_from_j2000)
    pose = pose.replaced(bodies=bodies_given(tuple(read_pose_file(files.pose).bodies), pose, target))
    scene = Scene(find_camera(str(files.camera)), target, map_of_target(target), SceneSettings(photometry="mixture"))
    return Frame(observation, scene, pose)


@pytest.mark.parametrize("off_deg", [0.0, 0.15, -0.25])
def test_a_planted_roll_is_found_by_the_planets_limb(frame: Frame, off_deg: float) -> None:
    pose = rolled(frame.pose, off_deg)
    found = roll_by_others(frame.observation, pose, pose, frame.scene, PRIORS)
    assert found is not None
    assert found.bodies == ("jupiter",)
    assert found.sigma_deg < 0.1
    assert found.roll_deg == pytest.approx(-off_deg, abs=2 * found.sigma_deg)
    assert found.priors(PRIORS).roll_deg == found.sigma_deg
    if off_deg:
        turned = found.predicted(pose).camera_from_j2000 - frame.pose.camera_from_j2000
        assert np.abs(turned).max() < np.abs(pose.camera_from_j2000 - frame.pose.camera_from_j2000).max()


def test_the_roll_is_from_the_predicted_pose_whatever_was_corrected_before(frame: Frame) -> None:
    predicted = rolled(frame.pose, 0.15)
    found = roll_by_others(frame.observation, frame.pose, predicted, frame.scene, PRIORS)
    assert found is not None
    assert found.roll_deg == pytest.approx(-0.15, abs=2 * found.sigma_deg)


def test_the_result_states_what_the_last_correction_had_the_roll_by(frame: Frame) -> None:
    found = roll_by_others(frame.observation, frame.pose, rolled(frame.pose, 0.15), frame.scene, PRIORS)
    assert found is not None
    with_it, without = (
        CorrectionResult(pose=frame.pose, changed={}, evidence=evidence)
        for evidence in ({"roll_by": found.to_dict()}, {"roll_by": None})
    )
    assert roll_by({"joint-1": without, "joint-2": with_it}) == found.to_dict()
    assert roll_by({"joint-1": with_it, "joint-2": without}) is None
    assert roll_by({}) is None


def test_what_tells_no_more_than_the_prior_or_contradicts_it_is_not_taken(frame: Frame) -> None:
    for off_deg, roll_deg in ((0.0, 0.005), (0.5, 0.06)):
        pose = rolled(frame.pose, off_deg)
        priors = PRIORS.model_copy(update={"roll_deg": roll_deg})
        assert roll_by_others(frame.observation, pose, pose, frame.scene, priors) is None
    alone = frame.pose.replaced(bodies=())
    assert roll_by_others(frame.observation, alone, alone, frame.scene, PRIORS) is None
