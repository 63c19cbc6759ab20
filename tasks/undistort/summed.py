"""The distortion of a camera whose pixels are summed: that of its detector, in larger pixels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tasks.undistort.model import DistortionModel, Points


@dataclass(frozen=True)
class SummedModel:
    """model: of the detector. summing: pixels of it along each side of a summed one, whose x is centred on
    (x + 0.5) summing - 0.5. raw_size_px, size_px: of the summed frames."""

    model: DistortionModel
    summing: int
    raw_size_px: tuple[int, int]
    size_px: tuple[int, int]

    @property
    def name(self) -> str:
        """The method's name."""
        return self.model.name

    def undistort_points(self, xy_raw: ArrayLike) -> Points:
        """Undistorted places (..., 2) of raw pixels (..., 2)."""
        return self._summed(self.model.undistort_points(self._whole(xy_raw)))

    def distort_points(self, xy: ArrayLike) -> Points:
        """Raw places (..., 2) of undistorted pixels (..., 2)."""
        return self._summed(self.model.distort_points(self._whole(xy)))

    def extrapolated(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """As the detector's model at these places (...,)."""
        return self.model.extrapolated(self._whole(xy))

    def uncertainty_px(self, xy: ArrayLike) -> NDArray[np.float64]:
        """1-sigma (...,) of one coordinate, summed pixels."""
        return self.model.uncertainty_px(self._whole(xy)) / self.summing

    def _whole(self, xy: ArrayLike) -> Points:
        return (np.asarray(xy, dtype=np.float64) + 0.5) * self.summing - 0.5

    def _summed(self, xy: Points) -> Points:
        return (xy + 0.5) / self.summing - 0.5
