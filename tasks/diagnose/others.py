"""Another bright body in the frame, such as a planet beside its moon: found by its extent, and masked."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation, Quality
from catalog.pose import Pose
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px
from tasks.undistort.saturation import areas

# What is brighter than this share between sky and the brightest area belongs to a body.
BRIGHT_SHARE = 0.1
# An area is another body's when it holds so many times the pixels of the target's disk, or leaves the frame and is so
# many radii long.
LARGER, LONGER = 2.0, 2.6
# Light that the optics scatter beyond its edge, pixels.
RIM_PX = 4
FEWEST_LEFT = 0.02


@dataclass(frozen=True)
class Others:
    """observation: with the other bodies' pixels masked. pixels: (ny, nx) which those are. centre_px, across_px: (x, y)
    and extents of the largest one, as far as it is in the frame."""

    observation: Observation
    pixels: NDArray[np.bool_]
    centre_px: tuple[float, float]
    across_px: tuple[int, int]


def without_others(observation: Observation, pose: Pose, scene: Scene) -> Others | None:
    """The observation without bodies that are too large to be the target at its predicted range; None when there are
    none, or nothing else is in the frame."""
    import cv2

    usable = observation.usable
    if not usable.any():
        return None
    radius = disk_radius_px(pose, scene.camera, scene.target)
    low, high = (float(v) for v in np.percentile(observation.image[usable], [1, 99.8]))
    bright = areas(usable & (observation.image > low + BRIGHT_SHARE * (high - low)))
    _, labels, stats, centres = cv2.connectedComponentsWithStats(bright.astype(np.uint8))
    ny, nx = bright.shape
    x, y, width, height, area = stats.T
    at_edge = (x == 0) | (y == 0) | (x + width == nx) | (y + height == ny)
    is_other = (area > LARGER * np.pi * radius**2) | (at_edge & (np.maximum(width, height) > LONGER * radius))
    is_other[0] = False  # the sky
    if not is_other.any():
        return None
    side = 2 * RIM_PX + 1
    pixels = cv2.dilate(is_other[labels].astype(np.uint8), np.ones((side, side), np.uint8)) > 0
    if np.count_nonzero(usable & ~pixels) < FEWEST_LEFT * pixels.size:
        return None
    flag = np.where(pixels, np.uint16(Quality.MASKED_BY_USER), np.uint16(0))
    largest = int(np.argmax(np.where(is_other, area, 0)))
    masked = replace(observation, quality=(observation.quality | flag).astype(np.uint16))
    centre = (float(centres[largest][0]), float(centres[largest][1]))
    return Others(masked, pixels, centre, (int(width[largest]), int(height[largest])))
