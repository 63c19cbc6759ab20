"""The common signature: an image crop and its simulation in, a shift out."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from tasks.simulate import Simulation


@dataclass(frozen=True)
class Match:
    """One crop of the observed image with its simulation, all under the same window (ny, nx). weight: inverse variance
    of the difference, 0 where the image cannot be used."""

    image: NDArray[np.float32]
    weight: NDArray[np.float32]
    simulation: Simulation

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Pixels that may be compared."""
        return self.weight > 0


@dataclass(frozen=True)
class Shift:
    """offset_px (2,): how far the image's target lies from the simulated one, (x, y). covariance: (2, 2), px^2, or None
    where a method gives none. iterations and a quality figure of the method's own (correlation, -1..1)."""

    offset_px: NDArray[np.float64]
    covariance: NDArray[np.float64] | None
    iterations: int
    quality: float


Registration = Callable[[Match], Shift]

# Maps and photometric laws are good to some per cent of the signal; noise alone would trust bright pixels too much.
MODEL_ERROR = 0.05


def match_under_window(observation: Observation, simulation: Simulation) -> Match:
    """Cut the observation to the simulation's window and weigh its pixels by noise and model error."""
    window = simulation.window
    image = window.crop(observation.image)
    usable = window.crop(observation.usable, fill=False)
    noise = window.crop(observation.noise, fill=1)
    bright = np.percentile(image[usable], 95) if usable.any() else 1.0
    variance = noise.astype(np.float64) ** 2 + (MODEL_ERROR * max(float(bright), 0.0)) ** 2
    weight = np.where(usable, 1.0 / np.maximum(variance, 1e-12), 0).astype(np.float32)
    return Match(image, weight, simulation)
