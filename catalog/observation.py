"""An image with what is known of each pixel, and the file it came from."""

import dataclasses
from dataclasses import dataclass, field
from enum import IntFlag
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.image_mode import FULL_FRAME, ImageMode
from catalog.pose import PartialPose


class Quality(IntFlag):
    """Bit flags of a pixel; the names are the CF `flag_meanings` of the cube. OCCULTED: the target is there, behind
    another body. ECLIPSED: another body or a ring takes sunlight away from what the pixel sees. OTHER_BODY: the pixel
    sees another body than the target, or rings."""

    MISSING = 1
    SATURATED = 2
    RESEAU = 4
    OUTSIDE_WINDOW = 8
    EXTRAPOLATED_DISTORTION = 16
    OFF_BODY = 32
    NIGHT_SIDE = 64
    LIMB = 128
    EXTRAPOLATED_MAP = 256
    MASKED_BY_USER = 512
    SUSPECT = 1024
    OCCULTED = 2048
    ECLIPSED = 4096
    OTHER_BODY = 8192


UNUSABLE = (
    Quality.MISSING
    | Quality.SATURATED
    | Quality.RESEAU
    | Quality.OUTSIDE_WINDOW
    | Quality.MASKED_BY_USER
    | Quality.OTHER_BODY
)


@dataclass(frozen=True)
class Observation:
    """Pixels of one frame: image float32 (ny, nx) in DN or calibrated units, its 1-sigma noise float32 (ny, nx), and
    quality uint16 (ny, nx) of `Quality` bits."""

    image: NDArray[np.float32]
    noise: NDArray[np.float32]
    quality: NDArray[np.uint16]

    def __post_init__(self) -> None:
        if self.image.ndim != 2 or not self.image.shape == self.noise.shape == self.quality.shape:
            raise ValueError(f"one shape needed: {self.image.shape}, {self.noise.shape}, {self.quality.shape}")

    @cached_property
    def usable(self) -> NDArray[np.bool_]:
        """Pixels (ny, nx) whose value may be compared with a simulation; not to be changed."""
        return (self.quality & UNUSABLE) == 0


@dataclass(frozen=True)
class Frame:
    """What a reader returns: the observation and its metadata.

    camera, target: catalog names, None when the file does not say. et: mid-exposure, None when unknown.
    label_pose: the parts of the pose that the label knows outright (LORRI). label_geometry: the scalars from which a
    pose can be built (Galileo), see `catalog.label_geometry`. undistorted: the frame is already in the camera's
    undistorted geometry (GEOMED). label: the flat label, for provenance. overruled: what the label says otherwise than
    the user, whose word counts. warnings: what else the user ought to know of the file, a sentence each. unclear: why
    `time`, `target` or `camera` are None although the label speaks of them. mode: summing and window; the observation
    is the whole frame in it. sources: where each known value came from: keywords, options.
    """

    product: str
    path: Path
    sha256: str
    format: str
    observation: Observation
    camera: str | None = None
    target: str | None = None
    et: float | None = None
    exposure_s: float | None = None
    filter: str | None = None
    undistorted: bool = False
    label_pose: PartialPose = field(default_factory=PartialPose)
    label_geometry: dict[str, float] | None = None
    label: dict[str, Any] = field(default_factory=dict)
    overruled: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    unclear: dict[str, str] = field(default_factory=dict)
    mode: ImageMode = FULL_FRAME
    sources: dict[str, str] = field(default_factory=dict)

    def replaced(self, **changes: Any) -> "Frame":
        """Copy with some fields replaced."""
        return dataclasses.replace(self, **changes)
