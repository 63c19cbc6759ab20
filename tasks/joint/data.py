"""The observed pixels under a window."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from tasks.simulate.window import Window

Image = NDArray[np.float32]


@dataclass(frozen=True)
class Data:
    """An observation cut to a window that may leave the frame."""

    observation: Observation
    window: Window

    @cached_property
    def image(self) -> Image:
        """(ny, nx), zero where unusable."""
        return np.where(self.usable, self.window.crop(self.observation.image), 0).astype(np.float32)

    @cached_property
    def usable(self) -> NDArray[np.bool_]:
        """(ny, nx)."""
        finite = np.isfinite(self.window.crop(self.observation.image, fill=np.nan))
        return self.window.crop(self.observation.usable, fill=False) & finite

    @cached_property
    def variance(self) -> Image:
        """Of the noise (ny, nx)."""
        noise = self.window.crop(self.observation.noise, fill=1)
        return np.asarray(noise**2, np.float32)

    @cached_property
    def bright(self) -> float:
        """Level of the bright parts of the picture."""
        return max(float(np.percentile(self.image[self.usable], 99)), 1e-6) if self.usable.any() else 1.0
