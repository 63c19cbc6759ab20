"""Image and fitted simulation as two plain pictures, for registrations that know nothing of brightness or masks."""

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.reasons import Reason
from tasks.compare.brightness import fit_brightness
from tasks.compare.match import Match

Picture = NDArray[np.float32]


def two_pictures(match: Match) -> tuple[Picture, Picture]:
    """(image, simulation in the image's units), both (ny, nx); unusable pixels of the image show the simulation.

    Raises FailedError when nothing is to be seen in the simulation.
    """
    model, _ = fit_brightness(match, match.simulation.bases)
    simulated = model.astype(np.float32)
    if not np.ptp(simulated) > 0:
        raise FailedError(
            Reason.DID_NOT_CONVERGE,
            "the registration has moved the target out of the frame, or its brightness to nothing.",
            "Check the picture, range and Sun direction.",
        )
    return np.where(match.usable, match.image, simulated).astype(np.float32), simulated


def parabola_peak(left: float, here: float, right: float) -> float:
    """Place of the maximum of a parabola through three equidistant values, within half a step of the middle one."""
    curvature = left - 2 * here + right
    return float(np.clip(0.5 * (left - right) / curvature, -0.5, 0.5)) if curvature < 0 else 0.0
