"""The cached step: diagnose. Its folder holds what it takes to understand a failed image: overlay and tried.json."""

import json
from typing import Any

import numpy as np

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.diagnose import DiagnoseSettings, Explanation, tried
from tasks.diagnose.judging import cause_of
from tasks.diagnose.telling import MAP, OTHER, STRAY, Diagnosis
from tasks.plain import plain
from tasks.point.rotation import pose_pointed_at
from tasks.publish.overlay import draw_overlay
from tasks.simulate import Scene
from tasks.stored import load_arrays, load_observation, pose_in, save_arrays, save_observation, scene_of
from tasks.undistort.saturation import with_plate_flagged
from tasks.undistort.step import DISTORTION
from tasks.work import Progress, Work

OVERLAY, TRIED = "overlay.png", "tried.json"
# Causes that the corrections can do without on another image than the given one, and what is told with the result.
REPLACED = {
    OTHER: "Look at the picture: a mask of your own (--mask) may be better.",
    STRAY: "It was corrected so; look at the picture.",
}
# Explanations whose frame is not the image's: their limb would be drawn in the wrong place.
OTHER_FRAME = ("mirrored", "rolled")


def run(work: Work) -> dict[str, Any]:
    """What explains the image (see `diagnosis_of`), None where nothing does or nothing was to be tried; and the doubt
    that a result without the map's markings, another body or stray light, if there comes to be one, is told with. Where
    another image than the given one is to be corrected, the folder holds it."""
    observation, predicted, scene = (
        load_observation(work.place("undistort")),
        pose_in(work.place("pose")),
        scene_of(work),
    )
    settings = DiagnoseSettings.model_validate(work.inputs["settings"])
    found: list[Explanation] = []
    diagnosis: Diagnosis | None = None
    if work.inputs["try"]:
        found, diagnosis = examined(observation, predicted, scene, settings, work.progress)
    told = [explanation.told(scene) for explanation in found]
    best = pictured(found, diagnosis)
    title = f"{work.inputs['product']}: {work.inputs['reason'].partition(':')[0]}"
    after = best.pose if best else predicted
    draw_overlay(
        observation.image, predicted, after, scene.camera, scene.target, work.folder / OVERLAY, title, "best limb"
    )
    content = {"reason": work.inputs["reason"], "predicted": predicted.to_dict(), "explanations": plain(told)}
    content["best_pose"] = best.pose.to_dict() if best else None
    (work.folder / TRIED).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    if diagnosis is None:
        return {"diagnosis": None, "evidence": {"tried": plain(told)}}
    cause = {"code": diagnosis.code, "fault": diagnosis.fault, "remedy": diagnosis.remedy}
    evidence: dict[str, Any] = {"tried": plain(told)}
    if diagnosis.code == MAP:
        evidence["doubt"] = (
            f"{MAP}: {diagnosis.fault} It was corrected without them; latitude and longitude are in doubt."
        )
    replaced = diagnosis.code in REPLACED and diagnosis.explanation is not None
    if replaced and diagnosis.explanation:
        evidence["doubt"] = f"{diagnosis.code}: {diagnosis.fault} {REPLACED[diagnosis.code]}"
        save_observation(work.folder, diagnosis.explanation.candidate.observation)
        save_arrays(work.folder / DISTORTION, **load_arrays(work.place("undistort") / DISTORTION))
    return {"diagnosis": cause, "replaced": replaced, "evidence": evidence}


def examined(
    observation: Observation, predicted: Pose, scene: Scene, settings: DiagnoseSettings, progress: Progress
) -> tuple[list[Explanation], Diagnosis | None]:
    """What was tried, with the predicted target brought into the frame, and what of it explains the image."""
    centre = (np.array(scene.camera.size_px) - 1) / 2
    inside = pose_pointed_at(predicted, scene.camera, centre)
    observation = with_plate_flagged(observation)
    seen = tried(observation, inside, scene, settings, progress)
    return seen.found, cause_of(seen, observation, inside, scene, settings)


def pictured(found: list[Explanation], diagnosis: Diagnosis | None) -> Explanation | None:
    """The explanation whose limb is drawn: the one that explains the image, else the one most like it."""
    if diagnosis and diagnosis.explanation and diagnosis.explanation.candidate.name not in OTHER_FRAME:
        return diagnosis.explanation
    same_frame = [each for each in found if each.candidate.name not in OTHER_FRAME]
    return max(same_frame, key=lambda each: each.likeness, default=None)
