"""What every distortion model can do."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.newton import PointMap, Points, solve_points

__all__ = ["DistortionModel", "Identity", "PointMap", "Points", "solve_points"]


class DistortionModel(Protocol):
    """Maps between a camera's raw frame and its undistorted one. Pixels (x, y), 0-based; points have shape (..., 2).

    Both directions accept points outside the frame; where a model has no answer it returns NaN.
    """

    @property
    def name(self) -> str:
        """The method's name."""
        ...

    @property
    def raw_size_px(self) -> tuple[int, int]:
        """Size (nx, ny) of the raw frame."""
        ...

    @property
    def size_px(self) -> tuple[int, int]:
        """Size (nx, ny) of the undistorted frame."""
        ...

    def __hash__(self) -> int: ...

    def undistort_points(self, xy_raw: ArrayLike) -> Points:
        """Undistorted places (..., 2) of raw pixels (..., 2)."""
        ...

    def distort_points(self, xy: ArrayLike) -> Points:
        """Raw places (..., 2) of undistorted pixels (..., 2)."""
        ...

    def extrapolated(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """True (...,) for undistorted pixels beyond what the model was measured on."""
        ...

    def uncertainty_px(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Expected 1-sigma error (...,) of one coordinate at undistorted pixels (..., 2), undistorted pixels; 0 when
        the model claims no error."""
        ...


class Identity:
    """No distortion: raw and undistorted frame are one."""

    name = "none"

    def __init__(self, size_px: tuple[int, int]) -> None:
        self.raw_size_px = self.size_px = size_px

    def undistort_points(self, xy_raw: ArrayLike) -> Points:
        """The same points (..., 2)."""
        return np.array(xy_raw, dtype=np.float64)

    def distort_points(self, xy: ArrayLike) -> Points:
        """The same points (..., 2)."""
        return np.array(xy, dtype=np.float64)

    def extrapolated(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """False everywhere."""
        return np.zeros(np.shape(xy)[:-1], dtype=bool)

    def uncertainty_px(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Zero everywhere."""
        return np.zeros(np.shape(xy)[:-1])
