"""The observed pixels under a window."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from tasks.compare.occulted import Occulted
from tasks.simulate.window import Window

Image = NDArray[np.float32]


@dataclass(frozen=True)
class Cutout:
    """An observation cut to a window that may leave the frame. behind: what the target hides of a body behind it, under
    the window, or None; the image is then without its light."""

    observation: Observation
    window: Window
    behind: Occulted | None = None

    @property
    def light_behind(self) -> Image | None:
        """(ny, nx) of the body behind the target, None where there is none."""
        return None if self.behind is None else self.behind.light

    @cached_property
    def hidden_share(self) -> tuple[float, float]:
        """What share of that light the target hides before the fit, and how far off, 1-sigma, that may be."""
        more = 0.0 if self.behind is None else (self.behind.most - 1) / 2
        return 1 + more, more

    @cached_property
    def image(self) -> Image:
        """(ny, nx), zero where its value is not known."""
        image = self.window.crop(self.observation.image)
        if self.behind is not None:
            image = image - self.behind.light
        return np.where(self.known, image, 0).astype(np.float32)

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """(ny, nx) whether the value is known."""
        finite = np.isfinite(self.window.crop(self.observation.image, fill=np.nan))
        return self.window.crop(self.observation.usable, fill=False) & finite

    @cached_property
    def usable(self) -> NDArray[np.bool_]:
        """(ny, nx) whether the value says something of the target."""
        return self.known if self.behind is None else self.known & self.behind.near

    @cached_property
    def variance(self) -> Image:
        """Of the noise (ny, nx), and of the light behind the target."""
        noise = self.window.crop(self.observation.noise, fill=1)
        unknown = 0.0 if self.behind is None else self.behind.sigma**2
        return np.asarray(noise**2 + unknown, np.float32)

    @property
    def clear(self) -> NDArray[np.bool_] | None:
        """(ny, nx) whether the value is known, and the light behind the target with it; None without such light."""
        return None if self.behind is None else self.known & self.behind.clear

    @cached_property
    def bright(self) -> float:
        """Level of the bright parts of the picture."""
        if not self.usable.any():
            return 1.0
        image = self.image if self.behind is None else self.image + self.behind.light
        return max(float(np.percentile(image[self.usable], 99)), 1e-6)
