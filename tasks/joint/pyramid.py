"""One image at a fraction of its resolution, and what is found there in pixels of the full one."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.reduce import reduced_observation, reduced_scene
from tasks.joint.parameters import NAMES, OFFSET, State
from tasks.joint.problem import Problem
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]


def width_in_frame_px(scene: Scene, pose: Pose) -> float:
    """Diameter of a whole disk that has as many pixels as the target at `pose` has in the frame."""
    whole = scene.window(pose)
    part = whole.clipped(scene.camera.size_px)
    share = part.shape[0] * part.shape[1] / max(whole.shape[0] * whole.shape[1], 1)
    return float(2 * disk_radius_px(pose, scene.camera, scene.target) * np.sqrt(share))


@dataclass(frozen=True)
class Level:
    """observation and scene with n x n of the image's pixels as one."""

    n: int
    observation: Observation
    scene: Scene

    @classmethod
    def of(cls, given: Problem, state: State, diameter_px: float) -> "Level":
        """The one at which the part of the disk at `state` that is in the frame has about as many pixels as a whole one
        of `diameter_px`, or the image itself."""
        n = max(1, round(width_in_frame_px(given.scene, state.pose) / diameter_px))
        return cls(n, reduced_observation(given.observation, n), reduced_scene(given.scene, n))

    def problem(self, given: Problem) -> Problem:
        """The image's problem, as it is here."""
        metadata = self.down(given.metadata)
        return replace(given, observation=self.observation, scene=self.scene, metadata=metadata)

    def down(self, state: State) -> State:
        """A state of the image, as it is here."""
        return self._scaled(state, 1 / self.n)

    def up(self, state: State) -> State:
        """A state found here, as it is in the image."""
        return self._scaled(state, float(self.n))

    @staticmethod
    def _scaled(state: State, factor: float) -> State:
        x, y = state.trail_px
        return State(state.pose, state.psf_sigma_px * factor, (x * factor, y * factor))

    def step_up(self, step: Array) -> Array:
        """A step (8,) found here, in the image's pixels."""
        up = np.ones(len(NAMES))
        up[OFFSET] = self.n
        return step * up

    def covariance_up(self, covariance: Array) -> Array:
        """A covariance (8, 8) found here, in the image's pixels."""
        scale = self.step_up(np.ones(len(NAMES)))
        return covariance * np.outer(scale, scale)

    def planes_down(self, planes: NDArray) -> NDArray:
        """Displacements (2, ny, nx) in pixels of the image, here."""
        ny, nx = (size // self.n for size in planes.shape[1:])
        cut = planes[:, : ny * self.n, : nx * self.n].reshape(2, ny, self.n, nx, self.n)
        return np.asarray(cut.mean(axis=(2, 4), dtype=np.float32) / np.float32(self.n))
