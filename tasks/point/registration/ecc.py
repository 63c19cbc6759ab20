"""Enhanced correlation coefficient (OpenCV; Evangelidis and Psarakis 2008, IEEE Trans. PAMI 30, 1858)."""

import numpy as np

from catalog.errors import FailedError
from catalog.reasons import Reason
from tasks.compare.match import Match
from tasks.point.registration.base import Shift
from tasks.point.registration.sampling import two_pictures

MAX_ITERATIONS, TOLERANCE, BLUR = 200, 1e-8, 5


def register_ecc(match: Match) -> Shift:
    """Offset that maximises the correlation of image and simulation; it must start within some pixels.

    Raises FailedError when OpenCV finds no way up.
    """
    import cv2

    image, simulated = two_pictures(match)
    warp = np.eye(2, 3, dtype=np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, MAX_ITERATIONS, TOLERANCE)
    usable = match.usable.astype(np.uint8)
    try:
        score, warp = cv2.findTransformECC(simulated, image, warp, cv2.MOTION_TRANSLATION, criteria, usable, BLUR)
    except cv2.error as error:
        raise FailedError(
            Reason.DID_NOT_CONVERGE, "ECC found no alignment of image and simulation.", "Try another registration."
        ) from error
    return Shift(warp[:, 2].astype(np.float64), None, MAX_ITERATIONS, float(score))
