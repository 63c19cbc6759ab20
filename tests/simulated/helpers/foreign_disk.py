"""A small renderer that shares nothing with the program's: a sphere far away, lit by the Sun, whose limb may rise and
fall with the position angle."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Law = Callable[[Array, Array], Array]
SUB = 5


def lambert(mu0: Array, mu: Array) -> Array:
    """Brightness by the cosines of incidence and emission."""
    return mu0


def lommel_seeliger(mu0: Array, mu: Array) -> Array:
    """The same of dark, powdery surfaces."""
    return mu0 / np.maximum(mu0 + mu, 1e-9)


def foreign_disk(
    size_px: tuple[int, int],
    centre_px: ArrayLike,
    radius_px: float,
    sun: ArrayLike,
    psf_sigma_px: float,
    law: Law = lambert,
    relief_px: Callable[[Array], Array] | None = None,
) -> Array:
    """Brightness (ny, nx) of a sphere of radius_px about centre_px, blurred by a Gaussian; sun (3,) its direction in
    the camera frame. relief_px: of the position angle, degrees 0 to 360 from +x towards +y, what is added to the
    radius."""
    from scipy.ndimage import gaussian_filter

    nx, ny = size_px
    fine = (np.arange(nx * SUB) + 0.5) / SUB - 0.5, (np.arange(ny * SUB) + 0.5) / SUB - 0.5
    x, y = np.meshgrid(fine[0] - np.asarray(centre_px)[0], fine[1] - np.asarray(centre_px)[1])
    radius = np.full(x.shape, float(radius_px))
    if relief_px is not None:
        radius = radius + relief_px(np.degrees(np.arctan2(y, x)) % 360)
    inside = 1 - (x**2 + y**2) / radius**2
    mu = np.sqrt(np.maximum(inside, 0))
    normal = np.stack([x / radius, y / radius, -mu])
    mu0 = np.maximum(np.tensordot(np.asarray(sun, float), normal, 1), 0)
    bright = np.where(inside > 0, law(mu0, mu), 0)
    return gaussian_filter(bright, psf_sigma_px * SUB).reshape(ny, SUB, nx, SUB).mean(axis=(1, 3))
