"""The cached step: joint."""

from typing import Any

import numpy as np

from catalog.pose import Pose
from tasks.correcting import plain_correction
from tasks.joint import JointSettings, find_pose_jointly
from tasks.simulate import Scene
from tasks.stored import load_arrays, load_observation, pose_in, scene_of
from tasks.undistort.step import DISTORTION
from tasks.work import Work


def run(work: Work) -> dict[str, Any]:
    """See `find_pose_jointly`."""
    settings = JointSettings.model_validate(work.inputs["settings"])
    observation = load_observation(work.place("undistort"))
    start, predicted = pose_in(work.place("pose")), pose_in(work.place("predicted"))
    scene, source = scene_of(work), work.inputs["pose_source"]
    distortion_px = distortion_near(work, scene, start)
    return plain_correction(
        find_pose_jointly(observation, start, predicted, source, scene, settings, work.progress, distortion_px)
    )


def distortion_near(work: Work, scene: Scene, pose: Pose) -> float:
    """Median of the distortion model's expected error over the target's window, pixels."""
    expected = load_arrays(work.place("undistort") / DISTORTION)["uncertainty_px"]
    window = scene.window(pose).clipped((expected.shape[1], expected.shape[0]))
    part = expected[window.y0 : window.y1, window.x0 : window.x1]
    return float(np.nanmedian(part)) if np.isfinite(part).any() else 0.0
