"""Does the picture show the blocks of a strong compression?"""

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation

# Side of the blocks of JPEG, and of the cosine transforms of spacecraft (Galileo's ICT among them).
BLOCK_PX = 8
# What is brighter than this share between sky and the brightest shows steps between blocks.
BRIGHT_SHARE = 0.1
# Steps beyond this percentile are the limb's and markings', and count as if they were there.
CLIPPED_PERCENT = 90.0
FEWEST_PIXELS = 400


def blocks_of(observation: Observation) -> float | None:
    """How many times as large the steps between neighbouring pixels are at the edges of a grid of blocks as elsewhere,
    the smaller one of rows and columns; about 1 in a picture without blocks, None where too little is bright."""
    usable = observation.usable
    if not usable.any():
        return None
    image = observation.image.astype(np.float64)
    low, high = np.percentile(image[usable], [1, 99.8])
    meant = usable & (image > low + BRIGHT_SHARE * (high - low))
    if np.count_nonzero(meant) < FEWEST_PIXELS:
        return None
    return min(step_ratio(image, meant), step_ratio(image.T, meant.T))


def step_ratio(image: NDArray[np.float64], meant: NDArray[np.bool_]) -> float:
    """Mean step along x at the place in BLOCK_PX where it is largest, by the median over the other places."""
    steps, both = np.abs(np.diff(image, axis=1)), meant[:, 1:] & meant[:, :-1]
    if not both.any():
        return 1.0
    steps = np.minimum(steps, np.percentile(steps[both], CLIPPED_PERCENT))
    places = np.arange(steps.shape[1]) % BLOCK_PX
    means = [float(steps[:, places == p][both[:, places == p]].mean()) for p in np.unique(places[both.any(axis=0)])]
    largest = int(np.argmax(means))
    others = float(np.median(np.delete(means, largest))) if len(means) == BLOCK_PX else 0.0
    return means[largest] / others if others > 0 else 1.0
