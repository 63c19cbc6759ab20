"""From detector pixels to millimetres in the focal plane, and how the camera's axes lie in it."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

Array = NDArray[np.float64]
Row = tuple[FiniteFloat, FiniteFloat]
SMALLEST_DETERMINANT = 1e-14  # mm^2 per px^2: pixels of 0.1 nm


class FocalPlane(BaseModel):
    """The detector in the focal plane: mm = mm_from_px (xy - origin_px) + offset_mm, as TRANSX and TRANSY of ISIS'
    instrument addenda have it, so that pixels need not be square nor the detector upright.

    origin_px: detector pixel (x, y), 0-based, integer at the pixel's centre. axes: the camera's +X and +Y, each a unit
    vector along the focal plane's axes; where a detector's lines run upwards (mirrored as seen with y down) they turn
    the undistorted frame the right way round.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    origin_px: Row
    mm_from_px: tuple[Row, Row]
    offset_mm: Row = (0.0, 0.0)
    axes: tuple[
        tuple[Annotated[int, Field(ge=-1, le=1)], Annotated[int, Field(ge=-1, le=1)]],
        tuple[Annotated[int, Field(ge=-1, le=1)], Annotated[int, Field(ge=-1, le=1)]],
    ] = ((1, 0), (0, 1))

    @model_validator(mode="after")
    def _sane(self) -> "FocalPlane":
        if abs(np.linalg.det(np.array(self.mm_from_px))) < SMALLEST_DETERMINANT:
            raise ValueError(f"mm_from_px {self.mm_from_px} has no inverse")
        if abs(np.linalg.det(np.array(self.axes, dtype=float))) != 1:
            raise ValueError(f"axes {self.axes} are not two of the directions (1, 0), (-1, 0), (0, 1), (0, -1)")
        return self

    def mm(self, xy_px: Array) -> Array:
        """Place in the focal plane (..., 2), mm, of detector pixels (..., 2)."""
        return (xy_px - np.array(self.origin_px)) @ np.array(self.mm_from_px).T + np.array(self.offset_mm)

    def px(self, mm: Array) -> Array:
        """Detector pixels (..., 2) of places in the focal plane (..., 2), mm."""
        inverse = np.linalg.inv(np.array(self.mm_from_px))
        return (mm - np.array(self.offset_mm)) @ inverse.T + np.array(self.origin_px)


def axes_of(mm_from_px: Array, handedness: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """The camera's +X along samples, and +Y along lines (or against them, where the detector is mirrored), as the
    nearest axes of the focal plane. handedness: +1 where the boresight is the focal plane's +Z, -1 where it is -Z."""
    along = np.linalg.inv(mm_from_px) * abs(np.linalg.det(mm_from_px)) ** 0.5  # rows: gradients of sample and line
    best: tuple[float, tuple[tuple[int, int], tuple[int, int]]] = (-np.inf, ((1, 0), (0, handedness)))
    for x in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        y = (-x[1] * handedness, x[0] * handedness)
        agreement = float(along[0] @ np.array(x)) + 1e-6 * float(along[1] @ np.array(y))
        best = max(best, (agreement, (x, y)), key=lambda each: each[0])
    return best[1]
