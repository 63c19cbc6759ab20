"""What is published about one image."""

from dataclasses import dataclass, field
from typing import Any

from catalog.camera import Camera
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.uncertainty import PoseUncertainty


@dataclass(frozen=True)
class Publication:
    """Everything that goes into one product folder.

    product: its name, a plain folder name. observation: the undistorted frame, camera.size_px large. pose_before: the
    predicted pose, pose_after: the corrected one, from which the planes are projected. result: the object that
    `--json` prints (its `cube` and `overlay` are replaced by names relative to the folder). settings: the resolved
    configuration, defaults included. provenance: hashes of image, label, kernels and map, code version, sources of the
    initial pose. result, settings and provenance are plain JSON values.
    """

    product: str
    observation: Observation
    camera: Camera
    target: Target
    pose_before: Pose
    pose_after: Pose
    uncertainty: PoseUncertainty
    result: dict[str, Any] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.product or self.product.startswith(".") or set(self.product) & set("/\\\0"):
            raise ValueError(f"{self.product!r} is no name for a folder")
        if self.observation.image.shape != self.camera.size_px[::-1]:
            raise ValueError(
                f"the observation is {self.observation.image.shape} (ny, nx), "
                f"the undistorted frame of {self.camera.name} {self.camera.size_px} (nx, ny)"
            )
