"""Light that slopes over the whole frame: stray light, found from the sky and taken away."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.robust import sigma_about_median

Array = NDArray[np.float64]
# Blocks of so many to each side of the frame; light that is smooth over the frame is even within one.
BLOCKS, ROUNDS = 32, 12
# Blocks brighter than the surface by so many of its robust sigmas belong to a body.
CLIPPED_SIGMAS = 2.5
# Light whose whole span is less than this share of what is brightest above it misleads nobody.
LEAST_SPAN = 0.05
FEWEST_BLOCKS = 60


@dataclass(frozen=True)
class Even:
    """observation: with the surface subtracted. span: from its lowest to its highest value in the frame."""

    observation: Observation
    span: float


def without_stray_light(observation: Observation) -> Even | None:
    """The observation less a surface of second degree through its sky; None where the sky is even, or too little of it
    is seen.

    The surface is fitted to medians of blocks, those above it left out until nothing changes (iterated one-sided
    sigma clipping).
    """
    ny, nx = observation.image.shape
    xy, values = block_medians(observation)
    kept = np.ones(len(values), bool)
    columns = quadratic(xy)
    coefficients: Array = np.zeros(columns.shape[1])
    for _ in range(ROUNDS):
        if np.count_nonzero(kept) < FEWEST_BLOCKS:
            return None
        coefficients = np.asarray(np.linalg.lstsq(columns[kept], values[kept], rcond=None)[0], np.float64)
        residual = values - columns @ coefficients
        sigma = sigma_about_median(residual[kept])
        now = residual < CLIPPED_SIGMAS * sigma + 1e-9 * max(float(np.abs(values).max()), 1e-9)
        if (now == kept).all():
            break
        kept = now
    y, x = np.mgrid[:ny, :nx]
    places = np.stack([2 * x / max(nx - 1, 1) - 1, 2 * y / max(ny - 1, 1) - 1], axis=-1).reshape(-1, 2)
    surface = (quadratic(places) @ coefficients).reshape(ny, nx)
    left = observation.image - surface
    span = float(np.ptp(surface))
    bright = float(np.percentile(left[observation.usable], 99.5))
    if span < LEAST_SPAN * bright:
        return None
    return Even(replace(observation, image=left.astype(np.float32)), span)


def block_medians(observation: Observation) -> tuple[Array, Array]:
    """Places (n, 2), -1..1 over the frame, and medians (n,) of the blocks that are mostly usable."""
    image, usable = observation.image, observation.usable
    ny, nx = image.shape
    places, values = [], []
    for rows in np.array_split(np.arange(ny), min(BLOCKS, ny)):
        for columns in np.array_split(np.arange(nx), min(BLOCKS, nx)):
            block = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            if 2 * np.count_nonzero(usable[block]) > usable[block].size:
                places.append((2 * columns.mean() / max(nx - 1, 1) - 1, 2 * rows.mean() / max(ny - 1, 1) - 1))
                values.append(float(np.median(image[block][usable[block]])))
    return np.array(places).reshape(-1, 2), np.array(values)


def quadratic(xy: Array) -> Array:
    """Columns (n, 6) of a surface of second degree."""
    x, y = xy.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
