"""The cached step: image_pose, the pose found in the image itself."""

from dataclasses import dataclass
from pathlib import Path

from catalog.pose import IN_IMAGE, POSE_KEYS
from tasks.fields import Content
from tasks.ingest.pose_step import PredictedPose
from tasks.initial_pose.find import find_pose
from tasks.initial_pose.settings import ImagePoseSettings
from tasks.scene_inputs import SceneFiles, SceneInputs, scene_of
from tasks.step import StepType
from tasks.stored import load_observation
from tasks.work import Work


class ImagePoseInputs(Content):
    """What the result depends on. et: of mid-exposure, None where the label does not say. kernels: name and content
    of each, in the order of loading."""

    scene: SceneInputs
    et: float | None
    kernels: tuple[tuple[str, str], ...]
    settings: ImagePoseSettings


@dataclass(frozen=True)
class ImagePoseFiles(SceneFiles):
    """kernels: files, folders and meta-kernels."""

    kernels: tuple[Path, ...]


def run(inputs: ImagePoseInputs, files: ImagePoseFiles, _: Work) -> PredictedPose:
    """The pose found in the image itself, for known camera and target (see `find_pose`)."""
    observation, scene = load_observation(files.image), scene_of(inputs.scene, files)
    found = find_pose(observation, scene, inputs.et, inputs.settings, files.kernels)
    return PredictedPose(
        pose=found.pose,
        target=inputs.scene.target,
        source=IN_IMAGE,
        sources=dict.fromkeys(POSE_KEYS, IN_IMAGE),
        evidence={"found": found.evidence, "sigmas": found.sigmas()},
        priors=found.priors,
        has_orientation=found.has_orientation,
        doubts=found.doubts,
    )


LABELS = {"kernels": "kernels", "scene.basemap": "base map", "et": "time in the label"}
STEP = StepType("image_pose", run, PredictedPose, ImagePoseSettings, changes=frozenset({"pose"}), labels=LABELS)
