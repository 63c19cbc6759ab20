"""A distortion that no file tells of: limb and markings show it, and the stated errors hold what it does."""

import cv2
import numpy as np
import pytest

from lab.simulate.plant import pose_error
from lab.simulate.small_world import clean_image, observed, scene_of, small_camera, true_pose
from tasks.joint import JointSettings, find_pose_jointly
from tasks.joint.problem import DistortionError

ONCE = JointSettings(second_start=False, displaced_px=0.15)
RADIUS_PX, SIDE = 60.0, 170


def bent(picture: np.ndarray, rms_px: float, turn: float) -> np.ndarray:
    """The picture displaced by a smooth field of second order about its middle, `rms_px` over the disk."""
    y, x = np.indices(picture.shape, np.float32)
    u, v = (x - SIDE / 2) / RADIUS_PX, (y - SIDE / 2) / RADIUS_PX
    field = np.stack([np.cos(turn) * u * v + np.sin(turn) * u * u, np.cos(turn) * v * v - np.sin(turn) * u * v])
    inside = np.hypot(u, v) < 1
    size = np.sqrt(((field[:, inside] - field[:, inside].mean(axis=1, keepdims=True)) ** 2).sum(axis=0).mean())
    dx, dy = (rms_px / size * field).astype(np.float32)
    return cv2.remap(picture.astype(np.float32), x - dx, y - dy, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


@pytest.mark.parametrize(("rms_px", "turn"), [(0.0, 0.0), (0.4, 0.0), (0.4, 2.0)])
def test_a_distortion_is_shown_and_is_in_the_errors(rms_px: float, turn: float) -> None:
    camera = small_camera(2 * RADIUS_PX, (SIDE, SIDE)).model_copy(update={"centre_px": (SIDE / 2, SIDE / 2)})
    scene, truth = scene_of(camera, photometry="mixture"), true_pose(camera, phase_deg=50)
    seen = observed(bent(clean_image(scene, truth), rms_px, turn))
    found = find_pose_jointly(seen, truth, truth, "file", scene, ONCE)
    reported = found.evidence["displacement"]
    error = pose_error(found.pose, truth, scene.camera, scene.target)
    sigma = np.array(found.uncertainty["offset_px"])
    print(f"\n{rms_px} px: {reported}, centre {np.round(error.centre_px, 3)}, stated {sigma.round(3)}")
    assert reported["is_shown"] == (rms_px > 0)
    assert (np.abs(error.centre_px) < 3 * sigma).all()
    known = find_pose_jointly(seen, truth, truth, "file", scene, ONCE, distortion=DistortionError(0.3))
    assert known.evidence["displacement"] is None
