"""Which part of the frame a picture shows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MARGIN = 0.10
FAR_APART = 1.5  # union of both limbs, in widths of the corrected one, beyond which a second panel is drawn


@dataclass(frozen=True)
class Box:
    """Rectangle in pixels, x0 < x1, y0 < y1."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def width(self) -> float:
        """Extent in x."""
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        """Extent in y."""
        return self.y1 - self.y0

    def widened(self, px: float) -> "Box":
        """Larger by `px` on all sides."""
        return Box(self.x0 - px, self.y0 - px, self.x1 + px, self.y1 + px)

    def clipped(self, frame: "Box") -> "Box | None":
        """The part inside `frame`, or None."""
        box = Box(max(self.x0, frame.x0), max(self.y0, frame.y0), min(self.x1, frame.x1), min(self.y1, frame.y1))
        return box if box.width > 1 and box.height > 1 else None


def box_of(xy_px: NDArray[np.float64]) -> Box | None:
    """Box around points (n, 2); None when all of them are behind the camera."""
    finite = xy_px[np.isfinite(xy_px).all(axis=1)]
    return Box(*finite.min(axis=0), *finite.max(axis=0)) if len(finite) else None


def union(*boxes: Box | None) -> Box:
    """Smallest box around those given; at least one must be."""
    given = [box for box in boxes if box is not None]
    low = np.min([(b.x0, b.y0) for b in given], axis=0)
    high = np.max([(b.x1, b.y1) for b in given], axis=0)
    return Box(*map(float, (*low, *high)))


def close_up(before: Box | None, after: Box | None, frame: Box) -> tuple[Box, bool]:
    """Box of the target with a margin, inside the frame, and whether the predicted limb is too far away to be in it."""
    if after is None:
        return frame, before is not None
    both = union(before, after)
    far_apart = before is None or max(both.width / after.width, both.height / after.height) > FAR_APART
    wanted = after if far_apart else both
    box = wanted.widened(max(4.0, MARGIN * max(after.width, after.height))).clipped(frame)
    return (box, far_apart) if box else (frame, True)
