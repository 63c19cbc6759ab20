"""Which detection is which catalog star, once an orientation is nearly known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from tasks.stars.orientation import Orientation, fit_orientation

Array = NDArray[np.float64]
Indices = NDArray[np.int_]
ROUNDS = 8
CLIP = 3.0  # sigmas of one coordinate within which a star is the one
LEAST_RADIUS_PX = 0.5
OTHER_BRIGHTNESS = 2.0  # magnitudes, beyond which a match in place is none: colours differ by less


@dataclass(frozen=True)
class Measured:
    """Detections: undistorted places (n, 2), 1-sigma (n,) of one coordinate, and the star images' heights (n,)."""

    xy_px: Array
    sigma_px: Array
    height: Array

    def only(self, chosen: NDArray | slice) -> "Measured":
        """Those that an index or a mask chooses."""
        return Measured(self.xy_px[chosen], self.sigma_px[chosen], self.height[chosen])


@dataclass(frozen=True)
class Matched:
    """detection, star: (m,) numbers that belong together. orientation: fitted to them. radius_px: within which a star
    was looked for at last."""

    detection: Indices
    star: Indices
    orientation: Orientation
    radius_px: float


def match_stars(
    camera: Camera, start: Array, directions: Array, magnitude: Array, seen: Measured, radius_px: float, least: int
) -> Matched | None:
    """Matches and fits in turn, in a circle that shrinks to the scatter found; None where fewer than `least` agree.

    directions, magnitude: of catalog stars (n, 3), (n,), apparent."""
    turned, radius, previous = start, radius_px, None
    for _ in range(ROUNDS):
        detection, star = mutual(camera, turned, directions, seen.xy_px, radius)
        detection, star = _of_like_brightness(detection, star, magnitude, seen.height)
        if len(detection) < least:
            return None
        found = fit_orientation(camera, turned, directions[star], seen.xy_px[detection], seen.sigma_px[detection])
        turned = found.camera_from_j2000
        pairs = (detection.tobytes(), star.tobytes())
        if pairs == previous:
            return Matched(detection, star, found, radius)
        previous = pairs
        sigma = float(np.sqrt(np.median(np.sum(found.residual_px**2, axis=1)) / (2 * np.log(2))))
        stated = float(np.median(seen.sigma_px[detection]))
        radius = float(np.clip(CLIP * max(sigma, stated), LEAST_RADIUS_PX, radius_px))
    return Matched(detection, star, found, radius)


def mutual(camera: Camera, turned: Array, directions: Array, xy_px: Array, radius_px: float) -> tuple[Indices, Indices]:
    """Detections and stars (m,) that are each other's nearest, no farther apart than `radius_px`."""
    places = camera.project(directions @ turned.T)
    near = np.flatnonzero(np.isfinite(places).all(axis=1))
    margin = radius_px + 1.0
    low, high = xy_px.min(axis=0) - margin, xy_px.max(axis=0) + margin
    near = near[((places[near] >= low) & (places[near] <= high)).all(axis=1)]
    if not len(near):
        return np.zeros(0, int), np.zeros(0, int)
    from scipy.spatial import cKDTree

    apart, star = cKDTree(places[near]).query(xy_px, distance_upper_bound=radius_px)
    back = cKDTree(xy_px).query(places[near])[1]
    own = np.flatnonzero(np.isfinite(apart))
    own = own[back[star[own]] == own]
    return own, near[star[own]]


def _of_like_brightness(detection: Indices, star: Indices, magnitude: Array, height: Array) -> tuple[Indices, Indices]:
    """Matches whose catalog magnitude is about that of their height."""
    if len(detection) < 3:
        return detection, star
    off = magnitude[star] + 2.5 * np.log10(np.maximum(height[detection], 1e-12))
    off = off - np.nanmedian(off)
    like = ~(np.abs(off) > OTHER_BRIGHTNESS)
    return detection[like], star[like]
