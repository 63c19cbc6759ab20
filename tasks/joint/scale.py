"""One image at a fraction of its resolution, and what is found there in pixels of the full one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.joint.parameters import NAMES, OFFSET, State
from tasks.simulate import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scale:
    """observation and scene with n x n of the image's pixels as one."""

    n: int
    observation: Observation
    scene: Scene

    @classmethod
    def of(cls, observation: Observation, scene: Scene, state: State, diameter_px: float) -> "Scale":
        """The finest at which the disk at `state` is about `diameter_px` wide, or the image itself."""
        n = reduction_for(state.pose, scene, diameter_px)
        return cls(n, reduced_observation(observation, n), reduced_scene(scene, n))

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
