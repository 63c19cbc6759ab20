"""The cached step: the pose that the metadata claim."""

from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from catalog.target import Target, find_target
from tasks.fields import CameraField, Content, PlainJson, PoseField
from tasks.image_file import ImageFiles, ImageInputs, frame_of
from tasks.ingest.pose import initial_pose
from tasks.priors import PriorSettings
from tasks.simulate.others import OtherBodiesSettings
from tasks.step import StepType
from tasks.work import Work


class PoseInputs(Content):
    """What the result depends on. frame: content of what the file says. target: what the catalog knows of its target,
    None where a kernel defines it. pose_file: its content. kernels: name and content of each kernel, in the order of
    loading. bodies: names of the other bodies to place; others: which of them count; catalog: content of the catalog's
    targets, which may be in the frame, None where no kernel places them."""

    image: ImageInputs
    camera: CameraField
    frame: str
    target: Target | None = None
    pose_file: str | None
    kernels: tuple[tuple[str, str], ...]
    bodies: tuple[str, ...] = ()
    others: OtherBodiesSettings = OtherBodiesSettings()
    catalog: str | None = None


@dataclass(frozen=True)
class PoseFiles(ImageFiles):
    """pose_file: of the user. kernels: files, folders and meta-kernels."""

    pose_file: Path | None
    kernels: tuple[Path, ...]


class PredictedPose(Content):
    """The pose that the corrections are about; fields as of `tasks.ingest.pose.InitialPose`. priors: its own 1-sigma
    errors, None where they are those of its sources. errors: what a pose
    file states of its own parts, 1-sigma. has_orientation: whether the body's orientation is known at all.
    doubts: what stays unknown of it, each as `code: fault. Remedy.`"""

    pose: PoseField
    target: Target
    source: str
    sources: dict[str, str]
    missing: tuple[str, ...] = ()
    kernels: tuple[dict[str, str], ...] = ()
    evidence: PlainJson
    priors: PriorSettings | None = None
    errors: dict[str, float] = Field(default_factory=dict)
    has_orientation: bool = True
    doubts: tuple[str, ...] = ()


def run(inputs: PoseInputs, files: PoseFiles, _: Work) -> PredictedPose:
    """The predicted pose, from pose file or ISD, SPICE, tables of an ISIS cube or label (see `initial_pose`).

    The target is looked up here too, for a kernel may define it."""
    frame = frame_of(inputs.image, files)
    target = inputs.image.given_target or find_target(str(frame.target), list(files.kernels))
    found = initial_pose(
        frame, inputs.camera, target, files.kernels, files.pose_file, inputs.image.flip, inputs.bodies, inputs.others
    )
    return PredictedPose(
        pose=found.pose,
        target=target,
        source=found.source,
        sources=found.sources,
        missing=found.missing,
        kernels=found.kernels,
        evidence=found.evidence,
        errors=found.errors,
    )


LABELS = {
    "pose_file": "pose file",
    "kernels": "kernels",
    "target": "catalog: targets",
    "catalog": "catalog: targets",
    "image.reader": "reader",
}
STEP = StepType("pose", run, PredictedPose, changes=frozenset({"pose"}), labels=LABELS)
