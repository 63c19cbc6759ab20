"""The cached step: validate."""

from collections.abc import Mapping
from typing import Any

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.attitude.markings import UNKNOWN_DEG, Markings, judged_markings, mismatch_of
from tasks.attitude.symmetry import better_flip, doubt_of_symmetry
from tasks.compare.brightness import fit_brightness
from tasks.compare.match import framed_window, match_scene
from tasks.compare.similarity import ssim
from tasks.plain import plain
from tasks.simulate import Scene
from tasks.stored import load_observation, pose_in, save_arrays, scene_of
from tasks.validate import ValidateSettings, validate_limb
from tasks.validate.blocks import blocks_of
from tasks.validate.dark_limb import dark_limb, doubt_of_dark_limb
from tasks.validate.limb import margin_px
from tasks.validate.sun import sun_in_image
from tasks.work import Work

# Sub-pixels across the disk of the picture before: its similarity need only be right to 0.001.
ACROSS_BEFORE = 400.0


def run(work: Work) -> dict[str, Any]:
    """Limb of the corrected pose (see `validate_limb`), and similarity under the predicted and the corrected one,
    where the image puts the Sun (see `sun_in_image`), and whether it shows the blocks of a compression."""
    observation, scene = load_observation(work.place("undistort")), scene_of(work)
    settings = ValidateSettings.model_validate(work.inputs["settings"])
    report = validate_limb(observation, pose_in(work.place("pose")), scene, settings)
    save_arrays(work.folder, xy_px=report.xy_px, shift_px=report.shift_px, horizontal=report.horizontal)
    before = similarity_before(observation, pose_in(work.place("predicted")), scene, settings)
    sun = sun_in_image(observation, pose_in(work.place("pose")), scene)
    outside = dark_limb(observation, pose_in(work.place("pose")), scene)
    oriented = orientation_of(observation, pose_in(work.place("pose")), scene, work.inputs)
    doubts = [*oriented.pop("doubts"), doubt_of_dark_limb(outside)]
    return {
        "limb": plain(report.to_dict()),
        "similarity": {"before": before, "after": plain(report.similarity)},
        "sun": plain(sun.to_dict()),
        "blocks": blocks_of(observation),
        "dark_limb": plain(outside.to_dict()),
        **plain(oriented),
        "doubt": " ".join(doubt for doubt in doubts if doubt) or None,
    }


def orientation_of(observation: Observation, pose: Pose, scene: Scene, inputs: Mapping[str, Any]) -> dict[str, Any]:
    """What the markings say of the orientation, unless an earlier step found out, and the doubts that follow."""
    prior_deg = inputs["attitude_prior_deg"] or UNKNOWN_DEG
    told = inputs["orientation"]
    if told is None:
        markings = judged_markings(observation, pose, scene, prior_deg)
        told = {**markings.to_dict(), "kept": None}
    else:
        markings = Markings(told["verdict"], told["correlation"], told["sigmas"])
    doubts = []
    if markings.verdict == "mismatched" and inputs["orientation"] is None:
        doubts.append(mismatch_of(markings))
    symmetry = better_flip(observation, pose, scene, markings, prior_deg)
    if symmetry is not None:
        doubts.append(doubt_of_symmetry(symmetry))
    return {"orientation": told, "symmetry": symmetry and symmetry.to_dict(), "doubts": doubts}


def similarity_before(observation: Observation, pose: Pose, scene: Scene, settings: ValidateSettings) -> float | None:
    """Similarity under the predicted pose; None when it puts the target outside the frame."""
    ny, nx = observation.image.shape
    try:
        window = scene.window(pose).clipped((nx, ny))
    except ValueError:  # behind the camera
        return None
    if min(window.shape) < 1:
        return None
    window = framed_window(scene, pose, margin_px=margin_px(settings))
    match = match_scene(observation, scene.coarser(pose, ACROSS_BEFORE), pose, window)
    similarity: float | None = plain(ssim(match.image, fit_brightness(match, match.simulation.bases)[0], match.usable))
    return similarity
