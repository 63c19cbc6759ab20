"""Smooth errors of a map's albedo, as a fit of the disk's brightness shows them, and what they do to its unknowns.

Albedo that the map has too bright on one side of the disk looks like another direction of the Sun, and is then in no
residual. Errors that change over the disk twice or three times look like nothing else: they are found from the
residuals. Their common size, beyond what noise makes of them, is estimated by moments; the errors of first order are
taken to be as large (considered parameters; Bierman 1977, Factorization Methods, chapter VIII).
"""

import numpy as np
from numpy.typing import NDArray

from tasks.joint.contradiction import size_of
from tasks.joint.normal_equations import scaled_inverse

Array = NDArray[np.float64]
Image = NDArray[np.float32]

# Of errors of first order, which look like another Sun; the others are of higher order.
FIRST = 2
# 1-sigma of each error before the fit, relative to the albedo, at the limb; surplus over chance that counts, sigmas.
EXPECTED, CHANCE_SIGMAS = 0.3, 2.0


def albedo_terms(x: Array, y: Array) -> Array:
    """Errors (k, ny, nx) of the albedo, relative, at places in units of the disk's radius, x towards the Sun: Zernike's
    polynomials (Noll 1976, J. Opt. Soc. Am. 66, 207), those of first order, and of second to fourth order those that
    are odd across the Sun's direction, so that no photometric law resembles them."""
    square = x * x + y * y
    third = (3 * x * x * y - y**3, y * (3 * square - 2))
    fourth = (4 * x * y * (x * x - y * y), 2 * x * y * (4 * square - 3))
    return np.stack([x, y, 2 * x * y, *third, *fourth])


def spread_by_albedo(
    columns: Image, light: Image, residual: Image, weight: Image, terms: Array, shared: float
) -> Array:
    """Covariance (n, n) that smooth errors of the albedo give the unknowns of `columns` (n, ny, nx). light (ny, nx): of
    the model's disk; residual (ny, nx): of the fit, in sigmas; weight (ny, nx): inverse variance; terms: see
    `albedo_terms`; shared: how many pixels err together."""
    known, count = weight > 0, len(columns)
    root = np.sqrt(weight[known].astype(np.float64))
    gains = terms[:, known] * light[known] * root
    design = np.concatenate([columns[:, known] * root, gains])
    normal = design @ design.T
    response = scaled_inverse(normal[:count, :count]) @ normal[:count, count:]
    kept = np.concatenate([np.arange(count), np.arange(count + FIRST, len(design))])
    information = normal[np.ix_(kept, kept)]
    prior = np.concatenate([np.zeros(count), np.full(len(gains) - FIRST, EXPECTED**-2)])
    left = residual[known].astype(np.float64)
    variance = float(left @ left) / max(len(left) - len(kept), 1) * shared
    inverse = scaled_inverse(information / variance + np.diag(prior))
    found = (inverse @ (design[kept] @ left) / variance)[count:]
    noise = np.diag(inverse @ information @ inverse / variance)[count:]
    passed = np.eye(len(found)) - inverse[count:, count:] * EXPECTED**-2
    size = size_of(found, noise, np.diag(passed @ passed.T), EXPECTED, CHANCE_SIGMAS)
    return np.asarray(size**2 * response @ response.T)
