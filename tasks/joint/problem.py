"""What the joint estimator is given: one image, what is known of it beforehand, and how it is to be solved."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from tasks.joint.parameters import GROUPS, NAMES, RANGE, State
from tasks.joint.settings import JointSettings
from tasks.joint.thresholds import Thresholds
from tasks.simulate import Scene

Array = NDArray[np.float64]
Progress = Callable[[str, int, str], None]


@dataclass(frozen=True)
class DistortionError:
    """What is known of the distortion model's error. smooth_px: 1-sigma of a coordinate near the disk. bending: (2, ny,
    nx) displacement of the frame's pixels by an error of 1-sigma that they all share, or None."""

    smooth_px: float = 0.0
    bending: NDArray[Any] | None = None


EXACT = DistortionError()


@dataclass(frozen=True)
class Problem:
    """observation: the image; scene: camera, target and base map; metadata: the state about which the priors are;
    sigmas: (8,) 1-sigma of the priors in the order of `parameters.NAMES`, inf where free; distortion: what is known of
    the distortion model's error; progress: called with step, iteration and a text; sun_deg: 1-sigma of the direction to
    the Sun, about each of two axes, 0 where it is known."""

    observation: Observation
    scene: Scene
    metadata: State
    sigmas: Array
    settings: JointSettings
    distortion: DistortionError = EXACT
    progress: Progress | None = None
    sun_deg: float = 0.0

    @property
    def thresholds(self) -> Thresholds:
        """What is decided by."""
        return self.settings.thresholds

    @property
    def held(self) -> NDArray[np.bool_]:
        """(8,) unknowns that stay as they are."""
        held = np.zeros(len(NAMES), bool)
        for group in self.settings.hold:
            held[list(GROUPS[group])] = True
        return held

    def with_settings(self, **changed: Any) -> "Problem":
        """The same with other settings of these names."""
        return replace(self, settings=self.settings.model_copy(update=changed))

    def with_attitude_held(self) -> "Problem":
        """The same with the target's orientation left as it is at the start."""
        hold = self.settings.hold
        return self if "attitude" in hold else self.with_settings(hold=(*hold, "attitude"))

    def with_free_range(self) -> "Problem":
        """The same without the range's prior."""
        sigmas = self.sigmas.copy()
        sigmas[RANGE] = np.inf
        return replace(self, sigmas=sigmas)
