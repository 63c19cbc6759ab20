"""The cached step: joint."""

from typing import Any

import numpy as np

from catalog.pose import Pose
from tasks.correcting import plain_correction
from tasks.joint import JointSettings, find_pose_jointly
from tasks.joint.uncertainty import DistortionError
from tasks.simulate import Scene
from tasks.stored import load_arrays, load_observation, pose_in, scene_of
from tasks.undistort.step import DISTORTION
from tasks.work import Work


def run(work: Work) -> dict[str, Any]:
    """See `find_pose_jointly`."""
    settings = JointSettings.model_validate(work.inputs["settings"])
    observation = load_observation(work.place("undistort"))
    start, predicted = pose_in(work.place("pose")), pose_in(work.place("predicted"))
    scene, sources = scene_of(work), work.inputs["pose_sources"]
    distortion = distortion_near(work, scene, start)
    return plain_correction(
        find_pose_jointly(observation, start, predicted, sources, scene, settings, work.progress, distortion)
    )


def distortion_near(work: Work, scene: Scene, pose: Pose) -> DistortionError:
    """The distortion model's expected error: median over the target's window of what is not the beam's bending."""
    known = load_arrays(work.place("undistort") / DISTORTION)
    variance, bending = known["uncertainty_px"] ** 2, known.get("bending_error_px")
    if bending is not None:
        variance = np.maximum(variance - (bending.astype(np.float32) ** 2).mean(axis=0), 0)
    window = scene.window(pose).clipped((variance.shape[1], variance.shape[0]))
    part = variance[window.y0 : window.y1, window.x0 : window.x1]
    smooth_px = float(np.sqrt(np.nanmedian(part))) if np.isfinite(part).any() else 0.0
    return DistortionError(smooth_px, bending)
