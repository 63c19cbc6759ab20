"""Planted turns about the line of sight are found again, and distinguished: of the camera, and of the target alone."""

import numpy as np
import pytest

from catalog.basemap import uniform_map
from catalog.observation import Observation
from lab.simulate.plant import planted, pose_error
from lab.simulate.small_world import EUROPA, observation_of, scene_of, small_camera, true_pose
from tasks.correction import Correction
from tasks.roll import RollSettings, find_roll
from tasks.roll.turns import camera_rolled, target_turned

CAMERA = small_camera(diameter_px=84, size_px=(124, 116)).model_copy(update={"centre_px": (51.3, 70.6)})
TRUTH = true_pose(CAMERA, phase_deg=60.0)
# Another law than the surface's, as in life; the offset and range are those that pointing leaves.
SCENE = scene_of(CAMERA, "lunar-lambert")
BAR_DEG = 0.1


@pytest.fixture(scope="module")
def observation() -> Observation:
    return observation_of(scene_of(CAMERA, "lommel-seeliger"), TRUTH)


def found(observation: Observation, wrong, **settings) -> Correction:
    return find_roll(
        observation, planted(wrong, CAMERA, (0.8, -0.5), 1.003, (0, 0, 0)), SCENE, RollSettings(**settings)
    )


@pytest.mark.parametrize("roll_deg", [0.2, -3.0, 30.0])
def test_a_planted_roll_of_the_camera_is_found(observation: Observation, roll_deg: float) -> None:
    result = found(observation, camera_rolled(TRUTH, -roll_deg))
    left = pose_error(result.pose, TRUTH, CAMERA, EUROPA)
    print(f"roll {roll_deg}: {result.changed['roll_deg']:.3f} deg by {result.evidence['decided_by']}, bar 0.1")
    assert result.changed["roll_deg"] == pytest.approx(roll_deg, abs=BAR_DEG)
    assert result.changed["turn_deg"] == 0
    assert left.attitude_deg < BAR_DEG
    if abs(roll_deg) > 1:
        assert (result.evidence["assigned_to"], result.evidence["decided_by"]) == ("camera", "image")


def test_a_turn_of_the_target_is_distinguished_from_a_roll_of_the_camera(observation: Observation) -> None:
    result = found(observation, target_turned(TRUTH, 20.0))
    print(f"turn -20: found {result.changed['turn_deg']:.3f} deg, decided by {result.evidence['decided_by']}, bar 0.1")
    assert result.changed["turn_deg"] == pytest.approx(-20, abs=BAR_DEG)
    assert (result.changed["roll_deg"], result.evidence["assigned_to"]) == (0, "target")
    np.testing.assert_array_equal(  # the camera was only pointed
        np.round(result.pose.camera_from_j2000 @ TRUTH.camera_from_j2000.T, 3), np.eye(3)
    )


def test_the_setting_decides_who_is_turned(observation: Observation) -> None:
    """The markings are turned back either way; under the wrong assignment the light is not."""
    result = found(observation, target_turned(TRUTH, 1.0), assign="target", reach_deg=0)
    assert result.changed["turn_deg"] == pytest.approx(-1, abs=BAR_DEG)
    assert result.evidence["decided_by"] == "setting"


def test_a_right_roll_stays_and_a_small_one_can_be_left_to_the_attitude(observation: Observation) -> None:
    result = found(observation, TRUTH)
    assert result.changed["roll_deg"] == pytest.approx(0, abs=BAR_DEG)
    left = found(observation, camera_rolled(TRUTH, 0.5), apply_from_deg=2.0)
    assert left.changed == {"roll_deg": None, "turn_deg": None}
    assert "attitude" in left.evidence["left"]
    assert "trials" not in left.evidence  # the scan alone could tell


def test_a_bland_disk_near_full_phase_has_no_roll() -> None:
    full = true_pose(CAMERA, phase_deg=0.5)
    bland = scene_of(CAMERA, basemap=uniform_map())
    wrong = camera_rolled(full, 25.0)
    result = find_roll(observation_of(bland, full), wrong, bland, RollSettings(max_iterations=4))
    print(f"contrast of the scan {result.evidence['scan_contrast']:.3f}: {result.evidence.get('left')}")
    assert result.changed["roll_deg"] is None
    assert result.pose is wrong
