"""Saturated areas: pixels that were clipped at one value, which nobody flagged, and how large such areas are.

A clipped disk is a plate; a hot pixel, a cosmic ray, a bright column or a star is not. What counts are areas into which
a square of SIDE_PX pixels fits, so that single pixels and lines, however bright, say nothing about the disk.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation, Quality

SIDE_PX = 5
FEWEST_PIXELS = 60
# Values count as one within this share of the image's span: resampled plates ripple by so much.
SAME = 1e-4
# A disk that is not clipped has pixels just below its highest value, too: within this share of the span.
NEAR = 0.02
# The next lower value counts as near only within this share: what is farther below a plate is the sky.
NEAREST = 0.1
# So many times as many pixels at the top value as near it make a plate. Measured on disks of 24 and 220 px at phase
# angles of 0-80 deg, in 20-250 whole numbers: 0.0-0.5 where nothing is clipped, 2.5 and more where it is at 3/4 of the
# peak.
PLATE_FACTOR = 2.0


@dataclass(frozen=True)
class Plate:
    """value: that the clipped pixels have. pixels: (ny, nx), which they are."""

    value: float
    pixels: NDArray[np.bool_]


def areas(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The part (ny, nx) of a mask that squares of SIDE_PX pixels fill."""
    import cv2

    square = np.ones((SIDE_PX, SIDE_PX), np.uint8)
    return np.asarray(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, square, borderValue=0) > 0)


def clipped_plate(observation: Observation) -> Plate | None:
    """The area that was clipped at one value, below the highest that its pixels could have or not; None when there is
    none among the usable pixels."""
    import cv2

    usable = observation.usable
    if np.count_nonzero(usable) < FEWEST_PIXELS:
        return None
    low = float(np.percentile(observation.image[usable], 1))
    image = np.where(usable, observation.image, np.float32(low))
    square = np.ones((SIDE_PX, SIDE_PX), np.uint8)
    high = float(cv2.morphologyEx(image, cv2.MORPH_OPEN, square).max())
    span = high - low
    if span <= 0:
        return None
    same = usable & (np.abs(image - high) <= SAME * span)
    pixels = areas(same)
    count = int(np.count_nonzero(pixels))
    if count < FEWEST_PIXELS:
        return None
    near = np.count_nonzero(usable & ~same & (np.abs(image - high) <= max(NEAR * span, _step_below(image, high, span))))
    return Plate(high, pixels) if count >= PLATE_FACTOR * near else None


def _step_below(image: NDArray[np.float32], high: float, span: float) -> float:
    """From the top value to the next lower one, so that also an image of few grey levels has values near its top."""
    lower = image[image < high - SAME * span]
    return min(1.01 * (high - float(lower.max())), NEAREST * span) if lower.size else 0.0


def with_plate_flagged(observation: Observation) -> Observation:
    """The observation with the pixels of its clipped area, if it has one, flagged as saturated."""
    plate = clipped_plate(observation)
    if plate is None:
        return observation
    flag = np.where(plate.pixels, np.uint16(Quality.SATURATED), np.uint16(0))
    return replace(observation, quality=(observation.quality | flag).astype(np.uint16))
