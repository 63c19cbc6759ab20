"""Summing and windows: which part of a camera's detector an image shows, and how many of its pixels make one."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Window = tuple[int, int, int, int]


@dataclass(frozen=True)
class ImageMode:
    """How an image was taken, a property of the image and not of the camera.

    summing: detector pixels along each side of an image pixel. window: (x0, y0, width, height) of what the file holds,
    in detector pixels, 0-based; None for the whole frame. source: where the mode was taken from, "" for a full frame.
    """

    summing: int = 1
    window: Window | None = None
    source: str = ""

    @property
    def shape(self) -> tuple[int, int] | None:
        """Lines and samples of the file's picture; None where it is the whole frame."""
        return None if self.window is None else (self.window[3] // self.summing, self.window[2] // self.summing)

    @property
    def first_px(self) -> tuple[int, int]:
        """Where the file's first pixel lies in the whole frame, summed pixels."""
        x0, y0 = (0, 0) if self.window is None else self.window[:2]
        return x0 // self.summing, y0 // self.summing

    def __str__(self) -> str:
        parts = [f"{self.summing}x{self.summing} summed"] if self.summing > 1 else []
        if self.window is not None:
            x0, y0, width, height = self.window
            parts.append(f"{width}x{height} detector pixels from ({x0}, {y0})")
        return ", ".join(parts) or "full frame"

    def placed(self, plane: NDArray[Any], frame_size_px: tuple[int, int], fill: Any) -> NDArray[Any]:
        """A plane of the file (ny, nx) in the whole frame of `frame_size_px` (nx, ny) summed pixels, `fill` around it;
        the plane itself where the file holds the whole frame."""
        if self.window is None:
            return plane
        x, y = self.first_px
        whole = np.full(frame_size_px[::-1], fill, plane.dtype)
        whole[y : y + plane.shape[0], x : x + plane.shape[1]] = plane
        return whole


FULL_FRAME = ImageMode()
