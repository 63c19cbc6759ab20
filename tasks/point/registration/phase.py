"""Phase correlation, to a hundredth of a pixel (the paper's imregcorr)."""

import numpy as np

from tasks.compare.brightness import correlation
from tasks.compare.match import Match
from tasks.point.registration.base import Shift
from tasks.point.registration.sampling import two_pictures

UPSAMPLING = 200


def register_phase(match: Match) -> Shift:
    """Offset where the inverse transform of the cross-power spectrum peaks, refined by a matrix-multiply transform
    (Guizar-Sicairos et al. 2008, Opt. Lett. 33, 156). Noise is kept down by leaving the spectrum's amplitude in once
    the pictures are close: pure phase counts empty frequencies as much as full ones.
    """
    from skimage.registration import phase_cross_correlation

    image, simulated = two_pictures(match)
    taper = np.outer(np.hanning(image.shape[0]), np.hanning(image.shape[1])).astype(np.float32) ** 0.25
    # One floor for both: a pedestal under one of them, tapered, would look like a shift.
    pictures = [(picture - simulated.min()) * taper for picture in (image, simulated)]
    coarse, _, _ = phase_cross_correlation(*pictures, normalization="phase")
    near = float(np.hypot(*coarse)) <= 1.5
    normalization = None if near else "phase"
    shift, _, _ = phase_cross_correlation(*pictures, upsample_factor=UPSAMPLING, normalization=normalization)
    return Shift(np.array([shift[1], shift[0]], np.float64), None, 1, correlation(image, simulated, match.usable))
