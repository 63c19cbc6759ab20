"""The paper's table 1: every registration brick gets a planted offset back; paper's figures beside ours."""

import numpy as np
import pytest
from simulated_world import observation_of, scene_of, small_camera, true_pose

from tasks.point import PointSettings, find_pointing
from tasks.point.registration import REGISTRATIONS
from tasks.point.rotation import pose_moved_by

PLANTED_PX = (20.32, -30.46)
# Error left by the paper's methods (its table 1): 2-D cross-correlation, imregcorr, imregtform.
PAPER_ERROR_PX = {"ncc": (0.32, 0.06), "phase": (0.02, 0.06), "intensity": (2.01, 0.02)}
OURS_AT_MOST_PX = {"least-squares": 0.02, "ecc": 0.02, "limb": 0.05, "features": 0.15}


@pytest.fixture(scope="module")
def planted():
    camera = small_camera(180.0, (320, 300))
    pose, scene = true_pose(camera), scene_of(camera)
    return observation_of(scene, pose), pose_moved_by(pose, camera, np.negative(PLANTED_PX)), scene


@pytest.mark.parametrize("name", sorted(REGISTRATIONS))
def test_a_planted_offset_is_recovered(name, planted):
    observation, predicted, scene = planted
    correction = find_pointing(observation, predicted, scene, PointSettings(registration=name))
    error = np.array(correction.changed["offset_px"]) - PLANTED_PX
    paper = PAPER_ERROR_PX.get(name)
    print(f"{name}: error {error[0]:+.4f}, {error[1]:+.4f} px; paper {paper or 'has no figure'}")
    allowed = np.maximum(paper, 0.02) if paper else OURS_AT_MOST_PX[name]
    assert (np.abs(error) <= allowed).all()
