"""What is published about one image."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.safe_name import is_safe_product_name
from catalog.target import Target
from tasks.project.uncertainty import PoseUncertainty

SENSOR, RESAMPLED = "sensor", "resampled"
NOT_RESAMPLED = "none"


@dataclass(frozen=True)
class SensorFrame:
    """The frame as the detector has it, for photometry: observation, its unresampled pixels (ny, nx); xy_px
    (ny, nx, 2), the place of each pixel's centre in the undistorted frame, NaN where the model knows none."""

    observation: Observation
    xy_px: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.xy_px.shape != (*self.observation.image.shape, 2):
            raise ValueError(f"places {self.xy_px.shape} for pixels {self.observation.image.shape}")


@dataclass(frozen=True)
class Publication:
    """Everything that goes into one product folder.

    product: its name, a plain folder name. observation: the undistorted frame, camera.size_px large. pose_before: the
    predicted pose, pose_after: the corrected one, from which the planes are projected. result: the object that
    `--json` prints (its `cube` and `overlay` are replaced by names relative to the folder). settings: the resolved
    configuration, defaults included. provenance: hashes of image, label, kernels and map, code version, sources of the
    initial pose. result, settings and provenance are plain JSON values.

    sensor: when given, the cube holds these pixels instead of the observation's. kernel: with which the observation was
    resampled. distortion_uncertainty_px: 1-sigma of each coordinate of the places in the undistorted frame, of the
    observation's shape; None or 0 where nobody knows it.
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
    sensor: SensorFrame | None = None
    kernel: str = NOT_RESAMPLED
    distortion_uncertainty_px: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        if not is_safe_product_name(self.product):
            raise ValueError(f"{self.product!r} is no name for a folder")
        if self.observation.image.shape != self.camera.size_px[::-1]:
            raise ValueError(
                f"the observation is {self.observation.image.shape} (ny, nx), "
                f"the undistorted frame of {self.camera.name} {self.camera.size_px} (nx, ny)"
            )
        place = self.distortion_uncertainty_px
        if place is not None and place.shape != self.observation.image.shape:
            raise ValueError(f"the distortion's uncertainty is {place.shape}, not {self.observation.image.shape}")

    @property
    def pixels(self) -> Observation:
        """The pixels that the cube holds."""
        return self.sensor.observation if self.sensor else self.observation

    @property
    def pixel_space(self) -> str:
        """`sensor` for unresampled pixels of the raw frame, `resampled` for those of the undistorted frame."""
        return SENSOR if self.sensor else RESAMPLED

    @property
    def uncertainty_not_included(self) -> tuple[str, ...]:
        """Names of what the uncertainties of latitude and longitude leave out, because nobody knows it."""
        place = self.distortion_uncertainty_px
        distortion_known = place is not None and bool((place > 0).any())
        return self.uncertainty.not_included + (() if distortion_known else ("distortion",))
