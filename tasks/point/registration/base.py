"""The common signature: an image crop with its simulation in, a shift out."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.compare.match import Match


@dataclass(frozen=True)
class Shift:
    """offset_px (2,): how far the image's target lies from the simulated one, (x, y). covariance: (2, 2), px^2, or None
    where a method gives none. iterations and a quality figure of the method's own (correlation, -1..1)."""

    offset_px: NDArray[np.float64]
    covariance: NDArray[np.float64] | None
    iterations: int
    quality: float


Registration = Callable[[Match], Shift]
