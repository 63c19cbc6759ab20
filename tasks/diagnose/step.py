"""The cached step: diagnose. Its folder holds what it takes to understand a failed image: overlay and tried.json."""

import json

import numpy as np

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.bodies.masks import alone
from tasks.diagnose import DiagnoseSettings, Explanation, tried
from tasks.diagnose.choice import cause_of
from tasks.diagnose.diagnosis import MAP, OTHER, STRAY, Diagnosis
from tasks.fields import Content, Json, PlainJson, PoseField
from tasks.plain import plain
from tasks.point.loop import PointSettings
from tasks.point.rotation import pose_pointed_at
from tasks.point.with_others import find_with_others
from tasks.publish.overlay import draw_overlay
from tasks.scene_inputs import SceneFiles, SceneInputs, scene_of
from tasks.simulate import Scene
from tasks.step import StepType
from tasks.stored import load_arrays, load_observation, save_arrays, save_observation
from tasks.undistort.saturation import with_plate_flagged
from tasks.undistort.step import DISTORTION
from tasks.work import Progress, Work

OVERLAY, TRIED = "overlay.png", "tried.json"
# Causes that the corrections can do without on another image than the given one, and what the result says of them.
REPLACED = {
    OTHER: "Look at the picture: a mask of your own (--mask) may be better.",
    STRAY: "It was corrected so; look at the picture.",
}
# Explanations whose frame is not the image's: their limb would be drawn in the wrong place.
OTHER_FRAME = ("mirrored", "rolled")


class DiagnoseInputs(Content):
    """What the result depends on. pose: the predicted one. reason: the failure's. try_explanations: whether a wrong
    pose, camera, target or map can be the cause of it."""

    scene: SceneInputs
    pose: PoseField
    product: str
    reason: str
    try_explanations: bool
    settings: DiagnoseSettings


class Cause(Content):
    """Why the image failed, as the failure states it: code, fault and remedy."""

    code: str
    fault: str
    remedy: str


class DiagnoseResult(Content):
    """diagnosis: None where nothing explains the image, or nothing was to be tried. replaced: whether the step's
    folder holds an image that is to be corrected in place of the given one, without another body or stray light. doubt:
    what a result without the cause says of it, if there comes to be one."""

    diagnosis: Cause | None = None
    replaced: bool = False
    doubt: str | None = None
    evidence: PlainJson


def run(inputs: DiagnoseInputs, files: SceneFiles, work: Work) -> DiagnoseResult:
    """The cause of a failure: what explains the image better than the predicted pose does (see `cause_of`)."""
    observation, predicted, scene = load_observation(files.image), inputs.pose, scene_of(inputs.scene, files)
    found: list[Explanation] = []
    diagnosis: Diagnosis | None = None
    if inputs.try_explanations:
        found, diagnosis = examined(observation, predicted, scene, inputs.settings, work.progress)
    summaries = [explanation.to_dict(scene) for explanation in found]
    best = pictured(found, diagnosis)
    title = f"{inputs.product}: {inputs.reason.partition(':')[0]}"
    after = best.pose if best else predicted
    draw_overlay(
        observation.image, predicted, after, scene.camera, scene.target, work.folder / OVERLAY, title, "best limb"
    )
    content: Json = {"reason": inputs.reason, "predicted": predicted.to_dict(), "explanations": plain(summaries)}
    content["best_pose"] = best.pose.to_dict() if best else None
    (work.folder / TRIED).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    evidence: Json = {"tried": summaries}
    if diagnosis is None:
        return DiagnoseResult(evidence=evidence)
    doubt = None
    if diagnosis.code == MAP:
        doubt = f"{MAP}: {diagnosis.fault} It was corrected without them; latitude and longitude are in doubt."
    replaced = diagnosis.code in REPLACED and diagnosis.explanation is not None
    if replaced and diagnosis.explanation:
        doubt = f"{diagnosis.code}: {diagnosis.fault} {REPLACED[diagnosis.code]}"
        save_observation(work.folder, diagnosis.explanation.candidate.observation)
        save_arrays(work.folder / DISTORTION, **load_arrays(files.image / DISTORTION))
    cause = Cause(code=diagnosis.code, fault=diagnosis.fault, remedy=diagnosis.remedy)
    return DiagnoseResult(diagnosis=cause, replaced=replaced, doubt=doubt, evidence=evidence)


def examined(
    observation: Observation, predicted: Pose, scene: Scene, settings: DiagnoseSettings, progress: Progress
) -> tuple[list[Explanation], Diagnosis | None]:
    """What was tried, with the predicted target brought into the frame, and what of it explains the image."""
    centre = (np.array(scene.camera.size_px) - 1) / 2
    inside = pose_pointed_at(predicted, scene.camera, centre)
    if predicted.bodies:
        place = find_with_others(observation, predicted, scene, PointSettings().min_overlap)
        observation = observation if place is None else alone(observation, place.pose, scene, place.step_px)
    observation = with_plate_flagged(observation)
    seen = tried(observation, inside, scene, settings, progress)
    return seen.found, cause_of(seen, observation, inside, scene, settings)


def pictured(found: list[Explanation], diagnosis: Diagnosis | None) -> Explanation | None:
    """The explanation whose limb is drawn: the one that explains the image, else the one most like it."""
    if diagnosis and diagnosis.explanation and diagnosis.explanation.candidate.name not in OTHER_FRAME:
        return diagnosis.explanation
    same_frame = [each for each in found if each.candidate.name not in OTHER_FRAME]
    return max(same_frame, key=lambda each: each.likeness, default=None)


STEP = StepType("diagnose", run, DiagnoseResult, DiagnoseSettings)
