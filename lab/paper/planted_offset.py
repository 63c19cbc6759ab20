"""The paper's table 1: a known offset is planted, and every registration has to give it back."""

import time
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from lab.simulate.small_world import observation_of, scene_of, small_camera, true_pose
from tasks.correction import Correction
from tasks.point import PointSettings, find_pointing
from tasks.point.rotation import pose_moved_by
from tasks.simulate import Scene

PLANTED_PX = (20.32, -30.46)
DIAMETER_PX = 180.0
FRAME_PX = (320, 300)


@dataclass(frozen=True)
class PlantedOffset:
    """observation: the simulated image. predicted: the pose whose pointing is wrong by `PLANTED_PX`. truth: the right
    one."""

    observation: Observation
    predicted: Pose
    truth: Pose
    scene: Scene


@dataclass(frozen=True)
class Retrieved:
    """found_px: (x, y) that one method gave back. history_px: the moves of its iterations, after the coarse search."""

    found_px: tuple[float, float]
    history_px: list[list[float]]
    seconds: float

    @property
    def first_px(self) -> NDArray[np.float64]:
        """What the first registration said (2,), before anything was rendered again."""
        later = np.array(self.history_px[1:], float).reshape(-1, 2).sum(axis=0)
        return np.array(self.found_px) - later

    @property
    def error_px(self) -> NDArray[np.float64]:
        """Found minus planted (2,)."""
        return np.subtract(self.found_px, PLANTED_PX)


@cache
def planted_offset() -> PlantedOffset:
    """Europa, 180 px wide, half lit, with noise, in a frame that is predicted `PLANTED_PX` away."""
    camera = small_camera(DIAMETER_PX, FRAME_PX)
    truth, scene = true_pose(camera), scene_of(camera)
    predicted = pose_moved_by(truth, camera, np.negative(PLANTED_PX))
    return PlantedOffset(observation_of(scene, truth), predicted, truth, scene)


def retrieve_offset(method: str) -> Retrieved:
    """Run the pointing loop with one registration. Raises as `find_pointing`."""
    world = planted_offset()
    started = time.perf_counter()
    settings = PointSettings.model_validate({"registration": method})
    correction: Correction = find_pointing(world.observation, world.predicted, world.scene, settings)
    x, y = correction.changed["offset_px"]
    return Retrieved((x, y), correction.evidence["history_px"], time.perf_counter() - started)
