"""Fill the reseau marks of an image, so that no later step sees them."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation, Quality
from tasks.undistort.reseau_marks import MarkState, ReseauMarks

MARK_RADIUS_PX = 3.2  # the spot's profile has fallen to 0.2 % there
LARGEST_DOUBT_PX = 2.0


def filled(observation: Observation, marks: ReseauMarks) -> Observation:
    """Observation whose marks are inpainted (biharmonic: in f1636832 off by 5 % on the disk and 1.3 DN on sky, where
    Telea and Navier-Stokes are off by half as much again) and flagged RESEAU.

    Marks inside the frame that were not found are covered too, as widely as their place is uncertain.
    """
    from skimage.restoration import inpaint_biharmonic

    mask = mark_mask(observation.image.shape, marks)
    if not mask.any():
        return observation
    known = np.nan_to_num(observation.image).astype(np.float64)
    image = inpaint_biharmonic(known, mask, split_into_regions=True).astype(np.float32)
    quality = observation.quality.copy()
    quality[mask] |= np.uint16(Quality.RESEAU)
    return dataclasses.replace(observation, image=image, quality=quality)


def mark_mask(shape: tuple[int, ...], marks: ReseauMarks) -> NDArray[np.bool_]:
    """Pixels (ny, nx) that a mark covers."""
    mask = np.zeros(shape, dtype=bool)
    seen = (marks.state != MarkState.OUTSIDE) & (marks.state != MarkState.BLANK)
    doubt = np.where(marks.found, 0.0, np.minimum(2.0 * marks.sigma_px, LARGEST_DOUBT_PX))
    reach = int(MARK_RADIUS_PX + LARGEST_DOUBT_PX) + 1
    for (x, y), radius in zip(marks.xy[seen], (MARK_RADIUS_PX + doubt)[seen], strict=True):
        left, top = max(int(x) - reach, 0), max(int(y) - reach, 0)
        window = mask[top : int(y) + reach + 2, left : int(x) + reach + 2]
        rows, columns = np.indices(window.shape)
        window |= np.hypot(columns + left - x, rows + top - y) <= radius
    return mask
