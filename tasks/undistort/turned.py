"""A distortion model whose undistorted frame is turned about the boresight."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tasks.undistort.model import DistortionModel, Points


@dataclass(frozen=True)
class TurnedModel:
    """`model`, with the camera's roll error removed: undistorted points are turned by `roll_deg` about `centre_px`,
    from +x (sample) towards +y (line)."""

    model: DistortionModel
    roll_deg: float
    centre_px: tuple[float, float]

    @property
    def name(self) -> str:
        """The inner model's name."""
        return self.model.name

    @property
    def raw_size_px(self) -> tuple[int, int]:
        """Size (nx, ny) of the raw frame."""
        return self.model.raw_size_px

    @property
    def size_px(self) -> tuple[int, int]:
        """Size (nx, ny) of the undistorted frame."""
        return self.model.size_px

    def undistort_points(self, xy_raw: ArrayLike) -> Points:
        """Undistorted places (..., 2) of raw pixels (..., 2)."""
        return self._turn(self.model.undistort_points(xy_raw), self.roll_deg)

    def distort_points(self, xy: ArrayLike) -> Points:
        """Raw places (..., 2) of undistorted pixels (..., 2)."""
        return self.model.distort_points(self.unturned(xy))

    def extrapolated(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """True (...,) for undistorted pixels beyond what the model was measured on."""
        return self.model.extrapolated(self.unturned(xy))

    def uncertainty_px(self, xy: ArrayLike) -> NDArray[np.float64]:
        """The inner model's 1-sigma error (...,) of one coordinate."""
        return self.model.uncertainty_px(self.unturned(xy))

    def unturned(self, xy: ArrayLike) -> Points:
        """Where undistorted pixels (..., 2) were before the turn."""
        return self._turn(xy, -self.roll_deg)

    def _turn(self, xy: ArrayLike, angle_deg: float) -> Points:
        c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
        offset = np.asarray(xy, dtype=np.float64) - self.centre_px
        return np.asarray(offset @ np.array([[c, s], [-s, c]]) + self.centre_px)
