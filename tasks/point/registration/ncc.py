"""Normalised cross-correlation over integer displacements, its peak refined by parabolas (paper, eq. 8)."""

import numpy as np

from tasks.compare.match import Match
from tasks.point.registration.base import Shift
from tasks.point.registration.sampling import parabola_peak, two_pictures

MIN_OVERLAP = 0.5


def register_ncc(match: Match) -> Shift:
    """Offset of the highest correlation among displacements that leave half of the crop in common.

    One pass is good to some tenths of a pixel; in the loop, which renders again at every step, the peak becomes
    symmetric and the parabola exact.
    """
    from skimage.registration._masked_phase_cross_correlation import cross_correlate_masked

    image, simulated = (picture.astype(np.float64) for picture in two_pictures(match))
    everywhere = np.ones(image.shape, bool)
    scores = cross_correlate_masked(
        image, simulated, match.usable, everywhere, mode="full", axes=(0, 1), overlap_ratio=MIN_OVERLAP
    )
    row, column = (int(i) for i in np.unravel_index(int(np.argmax(scores)), scores.shape))
    offset = np.array([column - image.shape[1] + 1.0, row - image.shape[0] + 1.0])
    if 0 < row < scores.shape[0] - 1 and 0 < column < scores.shape[1] - 1:
        offset[0] += parabola_peak(*(float(scores[row, column + d]) for d in (-1, 0, 1)))
        offset[1] += parabola_peak(*(float(scores[row + d, column]) for d in (-1, 0, 1)))
    return Shift(offset, None, 1, float(scores[row, column]))
