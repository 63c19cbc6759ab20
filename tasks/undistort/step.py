"""The cached step: undistort.

Later steps always get the undistorted image. Beside it, in DISTORTION, lies what else is known: the expected error of
the distortion at each undistorted pixel, how an error of the beam's bending would move them, and for the setting
space = sensor the unresampled frame with the undistorted place of each of its pixels.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from catalog.mask import masked, read_mask
from catalog.observation import Frame, Observation
from tasks.fields import CameraField, Content, PlainJson
from tasks.image_file import ImageFiles, ImageInputs, frame_of
from tasks.step import StepType
from tasks.stored import save_arrays, save_observation
from tasks.undistort import UndistortSettings, undistort
from tasks.undistort.frame_map import bending_error_planes, uncertainty_plane, undistorted_places
from tasks.undistort.saturation import with_plate_flagged
from tasks.work import Work

DISTORTION = "distortion"


class UndistortInputs(Content):
    """What the result depends on. undistorted: the frame is already in the camera's undistorted geometry.
    reseau_tables: content of the tables of marks that camera and settings name. mask: content of the user's mask."""

    image: ImageInputs
    camera: CameraField
    undistorted: bool
    settings: UndistortSettings
    reseau_tables: dict[str, str] = Field(default_factory=dict)
    mask: str | None = None


@dataclass(frozen=True)
class UndistortFiles(ImageFiles):
    """mask: of the user, whose non-zero pixels are not used."""

    mask: Path | None


class UndistortResult(Content):
    """model: name of the distortion model that was taken out."""

    model: str
    evidence: PlainJson


def run(inputs: UndistortInputs, files: UndistortFiles, work: Work) -> UndistortResult:
    """The undistorted image (see `undistort`), which goes into the step's folder."""
    frame, camera, settings = frame_of(inputs.image, files), inputs.camera, inputs.settings
    observation = with_plate_flagged(masked_by_user(files.mask, frame))
    resampling = settings.model_copy(update={"space": "resampled"})
    undistorted = undistort(observation, camera, resampling, frame.undistorted)
    save_observation(work.folder, undistorted.observation)
    beside: dict[str, NDArray[Any]] = {"uncertainty_px": uncertainty_plane(undistorted.model)}
    bending = bending_error_planes(undistorted.model)
    if bending is not None:
        beside["bending_error_px"] = bending.astype(np.float16)
    if settings.space == "sensor":
        sensor = undistort(observation, camera, settings, frame.undistorted).observation
        places = undistorted_places(undistorted.model)
        # The file's own values, also where marks were filled: quality says which those are.
        beside |= {
            "sensor_image": frame.observation.image,
            "sensor_noise": sensor.noise,
            "sensor_quality": sensor.quality,
        }
        beside |= {"sensor_x_px": places[..., 0], "sensor_y_px": places[..., 1]}
    save_arrays(work.folder / DISTORTION, **beside)
    evidence = undistorted.evidence | {"space": settings.space}
    if files.mask:
        evidence["mask"] = {"file": files.mask.name, "sha256": inputs.mask}
    return UndistortResult(model=undistorted.model.name, evidence=evidence)


def masked_by_user(mask: Path | None, frame: Frame) -> Observation:
    """The raw observation with the user's mask, if there is one, in its quality. The mask has the file's size, or that
    of the whole frame that a window was placed in."""
    if mask is None:
        return frame.observation
    pixels, (ny, nx) = read_mask(mask), frame.observation.image.shape
    if frame.mode.window is not None and pixels.shape == frame.mode.shape:
        pixels = frame.mode.placed(pixels, (nx, ny), False)
    return masked(frame.observation, pixels, mask)


STEP = StepType(
    "undistort",
    run,
    UndistortResult,
    UndistortSettings,
    changes=frozenset({"image"}),
    labels={"mask": "mask", "reseau_tables": "catalog: reseau tables"},
)
