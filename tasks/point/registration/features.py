"""Matched features: where the disk has enough texture, its markings tell the offset."""

import numpy as np

from catalog.errors import FailedError
from catalog.reasons import Reason
from catalog.robust import sigma_about_zero
from tasks.compare.brightness import correlation
from tasks.compare.match import Match
from tasks.point.registration.base import Shift
from tasks.point.registration.sampling import Picture, two_pictures

LOWE_RATIO = 0.8
MIN_MATCHES = 8
AGREE_PX = 1.5


def register_features(match: Match) -> Shift:
    """Median displacement of SIFT features (Lowe 2004, Int. J. Comput. Vis. 60, 91) that agree on one displacement.

    Raises FailedError when fewer than eight do: too bland a disk or map.
    """
    import cv2

    image, simulated = two_pictures(match)
    high = float(np.percentile(simulated, 99.5))
    sift = cv2.SIFT.create(contrastThreshold=0.01)
    mask = (match.simulation.coverage > 0.5).astype(np.uint8)
    here, words = sift.detectAndCompute(_eight_bit(simulated, high), mask)
    there, image_words = sift.detectAndCompute(_eight_bit(image, high), match.usable.astype(np.uint8))
    displacements = np.zeros((0, 2))
    if words is not None and image_words is not None and min(len(here), len(there)) >= 2:
        pairs = cv2.BFMatcher().knnMatch(words, image_words, k=2)
        good = [a for a, b in pairs if a.distance < LOWE_RATIO * b.distance]
        displacements = np.array([np.subtract(there[m.trainIdx].pt, here[m.queryIdx].pt) for m in good]).reshape(-1, 2)
    agreed = _agreeing(displacements)
    if len(agreed) < MIN_MATCHES:
        raise FailedError(
            Reason.TOO_FEW_FEATURES,
            f"only {len(agreed)} features of image and simulation agree, needed {MIN_MATCHES}.",
            "The disk or the map is too bland; try another registration.",
        )
    offset = np.median(agreed, axis=0)
    spread = np.array([sigma_about_zero(along) for along in (agreed - offset).T])
    covariance = np.diag((1.2533 * spread) ** 2 / len(agreed))
    return Shift(offset, covariance, 1, correlation(image, simulated, match.usable))


def _eight_bit(picture: Picture, high: float) -> np.ndarray:
    return np.clip(picture * (255.0 / max(high, 1e-12)), 0, 255).astype(np.uint8)


def _agreeing(displacements: np.ndarray) -> np.ndarray:
    """The largest set within AGREE_PX of one displacement."""
    if len(displacements) == 0:
        return displacements
    distance = np.linalg.norm(displacements[:, None] - displacements[None], axis=-1)
    return displacements[distance[np.argmax((distance < AGREE_PX).sum(axis=1))] < AGREE_PX]
