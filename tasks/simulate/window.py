"""Rectangles of pixels in the undistorted frame, and crops that may reach beyond the frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target


@dataclass(frozen=True)
class Window:
    """Pixels x0 <= x < x1, y0 <= y < y1; may lie partly or wholly outside the frame."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx)."""
        return self.y1 - self.y0, self.x1 - self.x0

    def clipped(self, size_px: tuple[int, int]) -> "Window":
        """The part inside a frame of (nx, ny) pixels; empty windows keep zero size."""
        x0, x1 = (min(max(v, 0), size_px[0]) for v in (self.x0, self.x1))
        y0, y1 = (min(max(v, 0), size_px[1]) for v in (self.y0, self.y1))
        return Window(x0, y0, x1, y1)

    def moved(self, dx: int, dy: int) -> "Window":
        """The same size elsewhere."""
        return Window(self.x0 + dx, self.y0 + dy, self.x1 + dx, self.y1 + dy)

    def nearest(self, size_px: tuple[int, int], first_px: tuple[int, int] = (0, 0)) -> "Window":
        """The part of at most (nx, ny) pixels that is nearest to a frame of that size whose first pixel is `first_px`;
        unlike `clipped` never empty, so that what is rendered is bounded by the frame wherever a pose puts a disk."""
        (x0, x1), (y0, y1) = (
            _nearest_span(low, high, size, first)
            for low, high, size, first in zip((self.x0, self.y0), (self.x1, self.y1), size_px, first_px, strict=True)
        )
        return Window(x0, y0, x1, y1)

    def crop(self, array: NDArray, fill: float = 0) -> NDArray:
        """Copy of `array` (ny, nx) under the window; `fill` where the window leaves the array."""
        out = np.full(self.shape, fill, dtype=array.dtype)
        inside = self.clipped((array.shape[1], array.shape[0]))
        if inside.x1 > inside.x0 and inside.y1 > inside.y0:
            rows = slice(inside.y0 - self.y0, inside.y1 - self.y0)
            columns = slice(inside.x0 - self.x0, inside.x1 - self.x0)
            out[rows, columns] = array[inside.y0 : inside.y1, inside.x0 : inside.x1]
        return out


def _nearest_span(low: int, high: int, size: int, first: int) -> tuple[int, int]:
    """The part of low <= x < high, at most `size` long, that is nearest to first <= x < first + size."""
    length = min(high - low, size)
    begin = min(max(first, low), high - length)
    return begin, begin + length


def disk_radius_px(pose: Pose, camera: Camera, target: Target) -> float:
    """Apparent radius of the target's largest sphere, pixels."""
    largest = max(target.radii_km)
    return camera.focal_length_px * largest / np.sqrt(max(pose.range_km**2 - largest**2, 1e-9))


def target_window(pose: Pose, camera: Camera, target: Target, margin_px: float | None = None) -> Window:
    """Smallest window that holds the target's disk and a margin of sky (default 8 px + 6 % of the radius).

    Raises ValueError when the target is behind the camera.
    """
    centre = camera.project(pose.target_in_camera_km)
    if not np.isfinite(centre).all():
        raise ValueError("the target is behind the camera")
    radius = disk_radius_px(pose, camera, target)
    # Off-axis disks stretch by the secant of the angle, squared along the radius.
    off_axis = np.hypot(*(centre - np.asarray(camera.centre_px))) / camera.focal_length_px
    reach = radius * (1 + off_axis**2) + (8 + 0.06 * radius if margin_px is None else margin_px)
    low, high = np.floor(centre - reach).astype(int), np.ceil(centre + reach).astype(int) + 1
    return Window(int(low[0]), int(low[1]), int(high[0]), int(high[1]))
