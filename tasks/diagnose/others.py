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
# A body has a limb: on this share of its edge, at least, the brightness rises within RIM_PX by this share of the span.
# Measured: 0.3 and more of planets' edges, terminators included, 0.00 of skies that are smooth over 30 px.
LIMB_SHARE, LIMB_STEP = 0.15, 0.25


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
    if not usable.any() or pose.bodies:  # those that are known are left out already
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
    for label in np.nonzero(is_other)[0]:
        is_other[label] = has_limb(observation.image, labels == label, LIMB_STEP * (high - low))
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


def has_limb(image: NDArray[np.float32], area: NDArray[np.bool_], step: float) -> bool:
    """Whether an area (ny, nx) ends in a step of brightness, as a body does and clouds or stray light do not."""
    import cv2

    side = np.ones((2 * RIM_PX + 1, 2 * RIM_PX + 1), np.uint8)
    inner = cv2.morphologyEx(area.astype(np.uint8), cv2.MORPH_ERODE, np.ones((3, 3), np.uint8), borderValue=1) > 0
    edge = area & ~inner
    smooth = cv2.blur(np.where(np.isfinite(image), image, 0).astype(np.float32), (3, 3))
    rise = cv2.dilate(smooth, side) - cv2.erode(smooth, side)
    return bool(edge.any() and np.mean(rise[edge] > step) >= LIMB_SHARE)
