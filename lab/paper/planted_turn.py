"""The paper's figure 19: Europa is turned, and optical flow and Kabsch have to say by how much."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from lab.simulate.small_world import observation_of, scene_of, small_camera, true_pose
from tasks.attitude.flow import Flow, optical_flow
from tasks.attitude.solve import AttitudeSettings, find_attitude, without_shading
from tasks.compare.match import match_scene

DIAMETER_PX = 200.0
FRAME_PX = (260, 250)
PLANTED_TURNS_DEG = ((0.6, -0.8, 0.5), (1.2, 1.5, -0.9), (-1.6, 1.9, 1.7))
TIMED_PX = 1024


@dataclass(frozen=True)
class PlantedTurn:
    """planted_deg, found_deg: (3,) rotation vectors of the body in its own frame, None when undetermined. image: the
    crop that was compared (ny, nx). flow: of the first comparison. seconds: of the whole correction."""

    planted_deg: tuple[float, ...]
    found_deg: tuple[float, ...] | None
    image: NDArray[np.float32]
    flow: Flow
    seconds: float

    @property
    def error_deg(self) -> float | None:
        """Angle between the turn that was found and the one that was planted."""
        if self.found_deg is None:
            return None
        left = rotation_from_vector_deg(self.found_deg) @ rotation_from_vector_deg(self.planted_deg).T
        return float(np.linalg.norm(vector_deg_from_rotation(left)))


def retrieve_turn(planted_deg: tuple[float, ...]) -> PlantedTurn:
    """Plant a turn (3,), body frame, in the prediction of a matched simulation, and find it again."""
    camera = small_camera(DIAMETER_PX, FRAME_PX)
    truth, scene = true_pose(camera), scene_of(camera)
    observation = observation_of(scene, truth)
    wrong = truth.replaced(body_from_j2000=rotation_from_vector_deg(planted_deg) @ truth.body_from_j2000)
    settings = AttitudeSettings()
    match = match_scene(observation, scene, wrong)
    image, texture, comparable = without_shading(match, settings.min_lit)
    flow = optical_flow(image, texture, comparable, settings.template_px, settings.search_px)
    started = time.perf_counter()
    found = find_attitude(observation, wrong, scene, settings).changed["attitude_deg"]
    seconds = time.perf_counter() - started
    return PlantedTurn(planted_deg, None if found is None else tuple(found), match.image, flow, seconds)


def flow_seconds(side_px: int = TIMED_PX) -> float:
    """Best of three wall-clock times of the flow of a whole frame of side_px x side_px random pixels."""
    frame = np.random.default_rng(0).random((side_px, side_px), dtype=np.float32)
    usable = np.ones(frame.shape, bool)
    seconds = []
    for _ in range(3):
        started = time.perf_counter()
        optical_flow(frame, frame, usable)
        seconds.append(time.perf_counter() - started)
    return min(seconds)
