"""The cached step: joint.

Where the disk shows the beam's bending (`beam_bending.bending_shown`), the step also leaves the image displaced by it,
and what is known of its distortion, for later steps to use in place of those of the step undistort; its result says so
by `image_moved`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from tasks.correcting import CorrectionInputs, CorrectionResult, correction_step, recorded
from tasks.fields import PoseField
from tasks.joint import JointSettings, find_pose_jointly
from tasks.joint.beam_bending import displacement_of
from tasks.joint.problem import DistortionError
from tasks.priors import PriorSettings
from tasks.scene_inputs import SceneFiles, scene_of
from tasks.simulate import Scene
from tasks.stored import load_arrays, load_observation, save_arrays, save_observation
from tasks.undistort.resample import displaced
from tasks.undistort.step import DISTORTION
from tasks.work import Work

Known = dict[str, NDArray[Any]]


class JointInputs(CorrectionInputs):
    """What the result depends on. predicted, pose_sources: what the priors are about, and where it comes from.
    own_priors: its own, None for those of its sources.
    markings_match: see `find_pose_jointly`. image_moved: what the disk tells of the beam's bending is in this image
    already, and measured again it would count twice."""

    predicted: PoseField
    pose_sources: dict[str, str]
    own_priors: PriorSettings | None = None
    markings_match: bool
    image_moved: bool
    settings: JointSettings


def run(inputs: JointInputs, files: SceneFiles, work: Work) -> CorrectionResult:
    """Pose, blur and brightness together, by least squares with priors (see `find_pose_jointly`)."""
    settings = inputs.settings.model_copy(update={"bending_px": None}) if inputs.image_moved else inputs.settings
    observation, scene = load_observation(files.image), scene_of(inputs.scene, files)
    known = load_arrays(files.image / DISTORTION)
    distortion = distortion_near(known, scene, inputs.pose)
    correction = find_pose_jointly(
        observation,
        inputs.pose,
        inputs.predicted,
        inputs.pose_sources,
        scene,
        settings,
        work.progress,
        distortion,
        inputs.markings_match,
        inputs.own_priors,
    )
    bending = correction.evidence["bending"]
    if bending is None:
        return recorded(correction)
    save_observation(
        work.folder, displaced(observation, displacement_of(bending["strength"], known["bending_error_px"]))
    )
    save_arrays(work.folder / DISTORTION, **known_after(known, bending["strength"], bending["sigma"]))
    return recorded(correction, image_moved=True)


def distortion_near(known: Known, scene: Scene, pose: Pose) -> DistortionError:
    """The distortion model's expected error: median over the target's window of what is not the beam's bending."""
    variance, bending = known["uncertainty_px"] ** 2, known.get("bending_error_px")
    if bending is not None:
        variance = np.maximum(variance - mean_square(bending), 0)
    window = scene.window(pose).clipped((variance.shape[1], variance.shape[0]))
    part = variance[window.y0 : window.y1, window.x0 : window.x1]
    smooth_px = float(np.sqrt(np.nanmedian(part))) if np.isfinite(part).any() else 0.0
    return DistortionError(smooth_px, bending)


def known_after(known: Known, strength: float, sigma: float) -> Known:
    """What is known of the distortion when the bending turned out to be off by `strength` of its sigmas, known to
    `sigma` of them."""
    import cv2

    bending = known["bending_error_px"]
    # The expected error is known on a coarser grid than its part that is the bending's, and may be the smaller one.
    smooth = np.maximum(known["uncertainty_px"] ** 2 - mean_square(bending), 0)
    after = known | {
        "uncertainty_px": np.sqrt(smooth + sigma**2 * mean_square(bending)).astype(np.float32),
        "bending_error_px": (sigma * bending.astype(np.float32)).astype(np.float16),
    }
    if "sensor_x_px" in known:
        x, y = (known[name].astype(np.float32) for name in ("sensor_x_px", "sensor_y_px"))
        for name, plane in zip(("sensor_x_px", "sensor_y_px"), displacement_of(strength, bending), strict=True):
            after[name] = known[name] - cv2.remap(plane, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return after


def mean_square(planes: NDArray[Any]) -> NDArray[np.float32]:
    """Of x and y (ny, nx)."""
    return np.asarray((planes.astype(np.float32) ** 2).mean(axis=0), np.float32)


STEP = correction_step("joint", run, JointSettings, frozenset({"pose", "image"}))
