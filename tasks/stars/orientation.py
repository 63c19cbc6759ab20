"""The camera's orientation by stars: weighted least squares of pixel residuals over three angles, robust against single
wrong stars."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.robust import huber_weight
from catalog.rotation import nearest_rotation, rotation_from_vector_deg

Array = NDArray[np.float64]
STEPS = 30
STILL_DEG = 1e-9
HUBER = 2.0  # residuals beyond this many sigmas count less
LEAST_SIGMA_PX = 0.003
FEWEST_FOR_SCALE = 6


@dataclass(frozen=True)
class Orientation:
    """camera_from_j2000: (3, 3). covariance_deg2: (3, 3) of small rotations about the camera's x, y and z (the roll).
    residual_px: (n, 2), measured less computed place. extra_sigma_px: error of one coordinate beyond the stated ones
    that the residuals show (distortion, star images unlike the model). weights: (n,), 1 for a star that counts fully.
    """

    camera_from_j2000: Array
    covariance_deg2: Array
    residual_px: Array
    extra_sigma_px: float
    weights: Array

    @property
    def rms_px(self) -> float:
        """Root mean square distance of the stars from their computed places."""
        return float(np.sqrt(np.mean(np.sum(self.residual_px**2, axis=1))))


def fit_orientation(camera: Camera, start: Array, directions: Array, xy_px: Array, sigma_px: Array) -> Orientation:
    """The orientation (3, 3) that brings apparent directions (n, 3) to undistorted pixels (n, 2) with 1-sigma errors of
    one coordinate (n,), from one near it.

    Stars beyond two sigmas lose weight (Huber). Where the residuals scatter more than stated, an error common to all
    stars is added to the stated ones until they agree; they are never lowered, for a few stars may agree better by
    chance. Source of the weights: Gauss-Markov, with an extra variance component by its moment estimate."""
    turned = np.asarray(start, dtype=np.float64)
    stated = np.maximum(sigma_px, LEAST_SIGMA_PX)
    extra, weights = 0.0, np.ones(len(xy_px))
    for _ in range(STEPS):
        places, slopes = projected(camera, turned, directions)
        residual = xy_px - places
        extra = extra_sigma(residual, stated)
        sigma = np.hypot(stated, extra)
        weights = huber_weight(np.linalg.norm(residual, axis=1) / sigma, HUBER)
        normal = np.einsum("nki,n,nkj->ij", slopes, weights / sigma**2, slopes)
        change = np.linalg.solve(normal, np.einsum("nki,n,nk->i", slopes, weights / sigma**2, residual))
        turned = rotation_from_vector_deg(np.degrees(change)) @ turned
        if np.abs(np.degrees(change)).max() < STILL_DEG:
            break
    places, slopes = projected(camera, turned, directions)
    normal = np.einsum("nki,n,nkj->ij", slopes, weights / sigma**2, slopes)
    covariance = np.linalg.inv(normal) * (180.0 / np.pi) ** 2
    return Orientation(nearest_rotation(turned), covariance, xy_px - places, extra, weights)


def focal_length_factor(
    camera: Camera, found: Orientation, directions: Array, xy_px: Array, sigma_px: Array
) -> tuple[float, float] | None:
    """The factor of the camera's focal length that the stars (n, 3) at pixels (n, 2) ask for, solved with the angles,
    and its 1-sigma; None with too few stars. It is a test of the camera's scale, and not part of the orientation."""
    if len(xy_px) < FEWEST_FOR_SCALE:
        return None
    places, slopes = projected(camera, found.camera_from_j2000, directions)
    columns = np.concatenate([slopes, (places - np.asarray(camera.centre_px))[:, :, None]], axis=-1)
    weights = found.weights / (np.maximum(sigma_px, LEAST_SIGMA_PX) ** 2 + found.extra_sigma_px**2)
    normal = np.einsum("nki,n,nkj->ij", columns, weights, columns)
    covariance = np.linalg.inv(normal)
    change = covariance @ np.einsum("nki,n,nk->i", columns, weights, xy_px - places)
    return float(1.0 + change[3]), float(np.sqrt(covariance[3, 3]))


def extra_sigma(residual_px: Array, stated_px: Array, unknowns: int = 3) -> float:
    """The error of one coordinate that, added to the stated ones (n,), makes the residuals (n, 2) what they ought
    to be with so many unknowns fitted; 0 where the stated ones suffice. Residuals count up to three times their median
    size."""
    size = np.linalg.norm(residual_px, axis=1)
    size = np.minimum(size, 3.0 * np.median(size))
    wanted = max(2 * len(size) - unknowns, 1)

    def excess(extra: float) -> float:
        return float(np.sum(size**2 / (stated_px**2 + extra**2))) - wanted

    if excess(0.0) <= 0:
        return 0.0
    from scipy.optimize import brentq

    return float(brentq(excess, 0.0, float(np.sqrt(np.sum(size**2) / wanted)) + 1e-9, xtol=1e-6))


def projected(camera: Camera, turned: Array, directions: Array) -> tuple[Array, Array]:
    """Pixels (n, 2) and their derivatives (n, 2, 3) by a small rotation (radians) about the camera's axes."""
    v = directions @ turned.T
    x, y = v[:, 0] / v[:, 2], v[:, 1] / v[:, 2]
    f = camera.focal_length_px
    along_x = np.stack([-x * y, 1 + x**2, -y], axis=-1)
    along_y = np.stack([-(1 + y**2), x * y, x], axis=-1)
    return camera.project(v), f * np.stack([along_x, along_y], axis=1)
