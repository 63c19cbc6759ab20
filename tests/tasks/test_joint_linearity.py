"""A detector whose signal is not proportional to light: the disk shows it, and the stated errors hold what it does."""

import numpy as np
import pytest

from lab.simulate.plant import pose_error
from lab.simulate.small_world import SKY_DN, clean_image, observed, scene_of, small_camera, true_pose
from tasks.joint import JointSettings, find_pose_jointly

ONCE = JointSettings(second_start=False)


@pytest.mark.parametrize(("power", "is_shown"), [(0.6, True), (1.0, False), (1.4, True)])
def test_a_power_of_the_signal_is_shown_by_the_disk_and_is_in_the_ranges_error(power: float, is_shown: bool) -> None:
    camera = small_camera(120.0, (160, 160)).model_copy(update={"centre_px": (79.5, 79.5)})
    scene = scene_of(camera)
    truth = true_pose(camera, phase_deg=45)
    light = np.maximum(clean_image(scene, truth) - SKY_DN, 0)
    picture = SKY_DN + light.max() * (light / light.max()) ** power
    found = find_pose_jointly(observed(picture), truth, truth, "file", scene, ONCE)
    reported = found.evidence["detector"]
    error = pose_error(found.pose, truth, scene.camera, scene.target)
    sigma = found.uncertainty["range_factor"]
    print(power, reported, f"range {error.range:+.5f}, stated {sigma:.5f}, centre {error.centre_px}")
    assert reported["is_shown"] == is_shown
    assert abs(error.range) < 3 * sigma
    if is_shown:
        assert np.sign(reported["power"] - 1) == np.sign(power - 1)
        assert abs(reported["power"] - power) < 0.2
