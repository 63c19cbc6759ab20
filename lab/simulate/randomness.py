"""Random numbers of one image: they depend on the seed, the product and the purpose, not on the order of doing."""

import zlib

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def generator(seed: int, product: str, purpose: str) -> np.random.Generator:
    """Generator for one purpose of one image."""
    return np.random.default_rng([seed, zlib.crc32(product.encode()), zlib.crc32(purpose.encode())])


class SmoothField:
    """A smooth random function on the sphere, mean about 0 and standard deviation 1: a sum of plane waves, each with
    between `smallest` and `largest` radians of phase per radius."""

    def __init__(self, rng: np.random.Generator, smallest: float, largest: float, waves: int = 12) -> None:
        direction = rng.standard_normal((3, waves))
        direction /= np.linalg.norm(direction, axis=0)
        self._wave_vectors = direction * rng.uniform(smallest, largest, waves)
        self._phases = rng.uniform(0, 2 * np.pi, waves)

    def __call__(self, unit: Array) -> Array:
        """Values (n,) at unit vectors (n, 3)."""
        terms = np.cos(unit @ self._wave_vectors + self._phases)
        return np.asarray(terms.sum(axis=-1) * np.sqrt(2 / len(self._phases)))


def exponential_between(rng: np.random.Generator, mean: float, smallest: float, largest: float) -> float:
    """A draw from the exponential distribution cut to [smallest, largest] whose mean is `mean` (the least informative
    one with these three figures); its density may rise or fall."""
    from scipy.optimize import brentq

    width = largest - smallest
    wanted = (mean - smallest) / width

    def mean_of(rate: float) -> float:
        return 0.5 if abs(rate) < 1e-6 else 1 / rate - 1 / np.expm1(rate)

    rate = brentq(lambda r: mean_of(r) - wanted, -500.0, 500.0)
    share = rng.uniform()
    fraction = share if abs(rate) < 1e-6 else -np.log1p(share * np.expm1(-rate)) / rate
    return float(smallest + width * fraction)
