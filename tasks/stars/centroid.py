"""Fits of a star image's place: a Gaussian over the pixels on a sloping sky, many peaks at a time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEPS = 12
FARTHEST_PX = 1.5  # of a fitted place from the peak's pixel
PLACE = slice(0, 2)
HEIGHT = 2


@dataclass(frozen=True)
class Fits:
    """xy_px: (n, 2). covariance_px2: (n, 2, 2) of the place, by the noise. height: (n,), of the Gaussian, image units;
    height_sigma: (n,). shape_px2: (n, 3), the Gaussian's xx, xy, yy. chi2: (n,) per degree of freedom; point_chi2: of
    one bright pixel on a sloping sky instead. pixels: (n,) how many were used."""

    xy_px: Array
    covariance_px2: Array
    height: Array
    height_sigma: Array
    shape_px2: Array
    chi2: Array
    point_chi2: Array
    pixels: NDArray[np.int_]


@dataclass(frozen=True)
class Stamps:
    """Pixels around peaks: x, y, value and weight (1 / sigma^2; 0 for unusable pixels), each (n, p), and the peaks'
    own pixels (n, 2)."""

    x: Array
    y: Array
    value: Array
    weight: Array
    peak: NDArray[np.int_]


def stamps(image: Array, variance: Array, usable: NDArray[np.bool_], peak: NDArray[np.int_], half: int) -> Stamps:
    """Square stamps of side 2 half + 1 around pixels (n, 2); what is outside the frame is unusable."""
    step = np.arange(-half, half + 1)
    dy, dx = (each.ravel() for each in np.meshgrid(step, step, indexing="ij"))
    x, y = peak[:, :1] + dx, peak[:, 1:] + dy
    ny, nx = image.shape
    inside = (x >= 0) & (x < nx) & (y >= 0) & (y < ny)
    at = (np.clip(y, 0, ny - 1), np.clip(x, 0, nx - 1))
    weight = np.where(inside & usable[at], 1.0 / variance[at], 0.0)
    return Stamps(x.astype(float), y.astype(float), image[at].astype(float), weight, peak)


def first(given: Stamps, count: int) -> Stamps:
    """The first stamps."""
    return Stamps(given.x[:count], given.y[:count], given.value[:count], given.weight[:count], given.peak[:count])


def fit_stars(given: Stamps, shape_px2: Array, free_shape: bool, model_error: float) -> Fits:
    """Gauss-Newton fits of place, height, sky and its slope; with `free_shape` also of the Gaussian's covariance.

    shape_px2: (2, 2), the star image's covariance, fixed or to start from. model_error: share of the height that is
    added to each pixel's sigma in proportion to the model, so that a bright star's wings do not outweigh all."""
    n = len(given.peak)
    shape = np.tile([shape_px2[0, 0], shape_px2[0, 1], shape_px2[1, 1]], (n, 1))
    place = given.peak.astype(float)
    height = np.ones(n)
    sky, weight = np.zeros((n, 3)), given.weight
    for step in range(STEPS):
        profile, slopes = _profile(given, place, shape)
        linear = [profile, np.ones_like(profile), given.x - given.peak[:, :1], given.y - given.peak[:, 1:]]
        if step == 0:  # the linear part alone
            found = _solved(np.stack(linear, axis=-1), given.value, weight)[0]
            height, sky = found[:, 0], found[:, 1:]
            weight = _weights(given.weight, np.maximum(height, 0.0)[:, None] * profile, model_error)
            continue
        model = height[:, None] * profile + np.einsum("nk,nkp->np", sky, np.stack(linear[1:], axis=1))
        columns = [height[:, None] * slopes[0], height[:, None] * slopes[1], *linear]
        if free_shape:
            columns += [height[:, None] * each for each in slopes[2:]]
        change, _ = _solved(np.stack(columns, axis=-1), given.value - model, weight)
        place = given.peak + np.clip(
            place + np.clip(change[:, PLACE], -0.5, 0.5) - given.peak, -FARTHEST_PX, FARTHEST_PX
        )
        height, sky = height + change[:, HEIGHT], sky + change[:, 3:6]
        if free_shape:
            shape = _bounded(shape + np.clip(change[:, 6:9], -0.3, 0.3) * shape[:, [0, 0, 2]])
    profile, slopes = _profile(given, place, shape)
    linear = [profile, np.ones_like(profile), given.x - given.peak[:, :1], given.y - given.peak[:, 1:]]
    model = height[:, None] * profile + np.einsum("nk,nkp->np", sky, np.stack(linear[1:], axis=1))
    columns = [height[:, None] * slopes[0], height[:, None] * slopes[1], *linear]
    _, covariance = _solved(np.stack(columns, axis=-1), given.value - model, weight)
    count = (given.weight > 0).sum(axis=1)
    freedom = np.maximum(count - 6, 1)
    chi2 = np.sum(weight * (given.value - model) ** 2, axis=1) / freedom
    return Fits(
        place, covariance[:, :2, :2], height, np.sqrt(covariance[:, 2, 2]), shape, chi2,
        _point_chi2(given, weight) / freedom, count,
    )  # fmt: skip


def _profile(given: Stamps, place: Array, shape: Array) -> tuple[Array, list[Array]]:
    """Gaussian (n, p) of unit height, and its derivatives by x, y, and the covariance's relative xx, xy, yy."""
    dx, dy = given.x - place[:, :1], given.y - place[:, 1:]
    xx, xy, yy = (shape[:, k : k + 1] for k in range(3))
    det = xx * yy - xy**2
    a, b, c = yy / det, -xy / det, xx / det
    u, v = a * dx + b * dy, b * dx + c * dy
    g = np.exp(-0.5 * (dx * u + dy * v))
    return g, [g * u, g * v, 0.5 * g * u * u * xx, g * u * v * xx, 0.5 * g * v * v * yy]


def _weights(weight: Array, star: Array, model_error: float) -> Array:
    variance = np.divide(1.0, weight, out=np.full_like(weight, np.inf), where=weight > 0)
    return np.asarray(1.0 / (variance + (model_error * star) ** 2))


def _solved(columns: Array, value: Array, weight: Array) -> tuple[Array, Array]:
    """Weighted least squares of n systems: unknowns (n, k) and covariances (n, k, k)."""
    normal = np.einsum("npi,np,npj->nij", columns, weight, columns)
    size = np.einsum("nii->ni", normal)
    normal = normal + np.eye(normal.shape[-1]) * (1e-9 * size + 1e-12)[:, None, :]
    covariance = np.linalg.inv(normal)
    right = np.einsum("npi,np,np->ni", columns, weight, value)
    return np.einsum("nij,nj->ni", covariance, right), covariance


def _bounded(shape: Array) -> Array:
    xx, yy = np.clip(shape[:, 0], 0.04, 100.0), np.clip(shape[:, 2], 0.04, 100.0)
    most = 0.98 * np.sqrt(xx * yy)
    return np.stack([xx, np.clip(shape[:, 1], -most, most), yy], axis=-1)


def _point_chi2(given: Stamps, weight: Array) -> Array:
    """Sum of squares left by one bright pixel at the peak on a sloping sky: all of its own is explained."""
    others = np.where((given.x == given.peak[:, :1]) & (given.y == given.peak[:, 1:]), 0.0, weight)
    columns = [np.ones_like(given.x), given.x - given.peak[:, :1], given.y - given.peak[:, 1:]]
    sky, _ = _solved(np.stack(columns, axis=-1), given.value, others)
    left = given.value - np.einsum("nk,nkp->np", sky, np.stack(columns, axis=1))
    return np.asarray(np.sum(others * left**2, axis=1))
