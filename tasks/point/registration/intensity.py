"""Mean squares by regular-step gradient descent on an image pyramid (the paper's imregtform)."""

import numpy as np
from numpy.typing import NDArray

from tasks.compare.brightness import correlation
from tasks.compare.match import Match
from tasks.point.registration.base import Shift
from tasks.point.registration.least_squares import moved
from tasks.point.registration.sampling import Picture, two_pictures

LEVELS = (4, 2, 1)
MAX_ITERATIONS = 200
FIRST_STEP_PX, LAST_STEP_PX = 1.0, 1e-4
RELAXATION = 0.5


def register_intensity(match: Match) -> Shift:
    """Offset by steps of given length down the gradient of the mean squared difference, shortened whenever the
    gradient turns back, on coarser to finer pictures."""
    image, simulated = two_pictures(match)
    offset, iterations = np.zeros(2), 0
    for level in LEVELS:
        if min(image.shape) // level < 16:
            continue
        usable = _reduced(match.usable.astype(np.float32), level) > 0.999
        offset, count = _descend(_reduced(image, level), _reduced(simulated, level), usable, offset / level)
        offset, iterations = offset * level, iterations + count
    return Shift(offset, None, iterations, correlation(image, moved(simulated, offset), match.usable))


def _reduced(picture: Picture, level: int) -> Picture:
    import cv2

    if level == 1:
        return picture
    ny, nx = picture.shape
    cut = picture[: ny // level * level, : nx // level * level]
    return cv2.resize(cut, (nx // level, ny // level), interpolation=cv2.INTER_AREA)


def _descend(
    image: Picture, simulated: Picture, usable: NDArray[np.bool_], start: NDArray[np.float64]
) -> tuple[NDArray[np.float64], int]:
    offset, step, before = start.copy(), FIRST_STEP_PX, np.zeros(2)
    for count in range(1, MAX_ITERATIONS + 1):
        shifted = moved(simulated, offset)
        difference = (shifted - image)[usable]
        # The simulation moves by +offset, so its change with the offset is minus its slope.
        slopes = np.stack([np.gradient(shifted, axis=axis)[usable] for axis in (1, 0)])
        gradient = -(slopes @ difference).astype(np.float64) / difference.size
        length = float(np.hypot(*gradient))
        if length < 1e-12:
            return offset, count
        if gradient @ before < 0:
            step *= RELAXATION
        if step < LAST_STEP_PX:
            return offset, count
        offset = offset - step * gradient / length
        before = gradient
    return offset, MAX_ITERATIONS
