"""The small world of `lab.simulate.small_world`, under the name by which the tests with planted truth import it."""

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation, Quality
from lab.simulate.small_world import (
    BODY_FROM_J2000,
    CAMERA_FROM_J2000,
    EUROPA,
    NOISE_DN,
    PEAK_DN,
    RANGE_KM,
    SKY_DN,
    TRUTH_OVERSAMPLE,
    clean_image,
    europa_map,
    observation_of,
    observed,
    scene_of,
    small_camera,
    true_pose,
)

__all__ = [
    "BODY_FROM_J2000",
    "CAMERA_FROM_J2000",
    "EUROPA",
    "NOISE_DN",
    "PEAK_DN",
    "RANGE_KM",
    "SKY_DN",
    "TRUTH_OVERSAMPLE",
    "clean_image",
    "europa_map",
    "flagged",
    "observation_of",
    "observed",
    "scene_of",
    "small_camera",
    "true_pose",
]


def flagged(observation: Observation, where: NDArray[np.bool_], value: float = np.nan) -> Observation:
    """Copy with the pixels `where` set to `value` and flagged MISSING."""
    image = np.where(where, np.float32(value), observation.image)
    quality = np.where(where, np.uint16(Quality.MISSING), observation.quality)
    return Observation(image, observation.noise, quality.astype(np.uint16))
