"""The sky of a frame that is nearly all sky, where it is not even: stray light and dark current."""

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.robust import sigma_about_zero

# A frame nearly all of whose pixels lie on a surface of third degree, within so many sigmas, shows an uneven sky, of
# stray light or dark current (Voyager's C1201656: 95 % of the frame, 20 to 50 DN, beside a crescent of 30 DN).
# The scatter about it is that of the noise, up to a factor: a disk's shading is none.
SKY_DEGREE, SKY_SHARE, SKY_SIGMAS, SKY_ROUNDS, SKY_STEP_PX, SKY_NOISE = 3, 0.9, 3.0, 8, 8, 3.0


def with_even_sky(clean: NDArray[np.float32], known: NDArray[np.bool_], noise: float) -> NDArray[np.float32]:
    """The image (ny, nx) less the slope of its sky, where nearly all of the frame is a sky that is not even; else the
    image itself. known: pixels with a value; noise: their 1-sigma."""
    coarse = (slice(None, None, SKY_STEP_PX),) * 2
    ny, nx = clean.shape
    y, x = (np.linspace(-1, 1, size) for size in (ny, nx))
    powers = [(i, j) for i in range(SKY_DEGREE + 1) for j in range(SKY_DEGREE + 1 - i)]
    seen, values = known[coarse], clean[coarse][known[coarse]].astype(np.float64)
    terms = np.stack([np.outer(y[::SKY_STEP_PX] ** i, x[::SKY_STEP_PX] ** j)[seen] for i, j in powers], axis=1)
    if len(values) < 10 * len(powers):
        return clean
    kept = np.abs(values - np.median(values)) <= np.percentile(np.abs(values - np.median(values)), 100 * SKY_SHARE)
    for _ in range(SKY_ROUNDS):
        fitted = terms @ np.linalg.lstsq(terms[kept], values[kept], rcond=None)[0]
        sigma = sigma_about_zero(values - fitted)
        kept = np.abs(values - fitted) <= SKY_SIGMAS * sigma
        if np.count_nonzero(kept) < SKY_SHARE * len(kept) or not 0 < sigma <= SKY_NOISE * noise:
            return clean
    if np.ptp(fitted) <= SKY_SIGMAS * sigma:
        return clean
    coefficients = np.linalg.lstsq(terms[kept], values[kept], rcond=None)[0]
    sky = sum(c * np.outer(y**i, x**j) for c, (i, j) in zip(coefficients, powers, strict=True))
    return np.asarray(clean - sky + float(np.median(fitted)), dtype=np.float32)


def is_uneven_sky(observation: Observation) -> bool:
    """Whether nearly all of the frame is a sky that is not even (see `with_even_sky`): what is bright around a disk is
    then no body behind it."""
    usable = observation.usable
    noise = float(np.median(observation.noise[usable])) if usable.any() else 0.0
    return with_even_sky(observation.image, usable, noise) is not observation.image
