"""What of a camera its images may be solved for, and the distance at which its distortion is stated."""

import numpy as np

from catalog.camera import Camera

FOCAL_LENGTH, DISTORTION = "focal-length", "distortion"
SOLVABLE = (FOCAL_LENGTH, DISTORTION)


def corner_of(camera: Camera) -> float:
    """Half diagonal of the frame, pixels."""
    return float(np.hypot(*camera.size_px) / 2)
