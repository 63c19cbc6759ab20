"""The cached step: undistort.

Later steps always get the undistorted image. Beside it, in DISTORTION, lies what else is known: the expected error of
the distortion at each undistorted pixel, how an error of the beam's bending would move them, and for the setting
space = sensor the unresampled frame with the undistorted place of each of its pixels.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.mask import masked, read_mask
from catalog.observation import Observation
from tasks.plain import plain
from tasks.stored import camera_of, frame_of, save_arrays, save_observation
from tasks.undistort import UndistortSettings, undistort
from tasks.undistort.frame_map import bending_error_planes, uncertainty_plane, undistorted_places
from tasks.undistort.saturation import with_plate_flagged
from tasks.work import Work

DISTORTION = "distortion"


def run(work: Work) -> dict[str, Any]:
    """See `undistort`; the observation goes into the step's folder."""
    frame, camera = frame_of(work), camera_of(work)
    observation = with_plate_flagged(masked_by_user(work, frame.observation))
    settings = UndistortSettings.model_validate(work.inputs["settings"])
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
    if "mask" in work.inputs:
        evidence["mask"] = {"file": work.place("mask").name, "sha256": work.inputs["mask"]}
    return {"model": undistorted.model.name, "evidence": plain(evidence)}


def masked_by_user(work: Work, observation: Observation) -> Observation:
    """The raw observation with the user's mask, if there is one, in its quality."""
    if "mask" not in work.inputs:
        return observation
    path = work.place("mask")
    return masked(observation, read_mask(path), path)
