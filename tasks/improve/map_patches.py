"""Patches of ground of a map, and an image matched with them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.target import Target
from tasks.control.matching import match_patches
from tasks.control.patches import Places, patches_of
from tasks.control.settings import ControlSettings
from tasks.control.ties import pixel_covariances, places_seen
from tasks.geometry.bilinear import map_values
from tasks.mosaic.view import View
from tasks.photometry.laws import find_law
from tasks.project.points import latitude_longitude, pixels_of_points

Array = NDArray[np.float64]
Image = NDArray[np.float32]
# PSF, square pixel and resampling of an image together, as a Gaussian, pixels (docs/guide/mosaic.md).
SMEARED_PX = 0.9
MARGIN = 4  # pixels of a patch beyond its edge, for the smoothing
LEAST_SMOOTHING_PX = 0.15
FEWEST_PATCHES = 3


@dataclass(frozen=True)
class GroundMap:
    """reflectance (rows, columns): from the north pole and east of `left_edge_deg`, 0 where not known; resolution_km:
    of what it was made from; pixel_km: side of a pixel at the equator."""

    reflectance: Image
    resolution_km: Image
    left_edge_deg: float
    pixel_km: float

    def values(self, plane: Image, points_km: Array) -> Array:
        """Of a plane (rows, columns) at body-fixed points (..., 3)."""
        return map_values(plane, self.left_edge_deg, *latitude_longitude(points_km))


@dataclass(frozen=True)
class MapTies:
    """n places of the map as an image shows them. place (n,): their numbers; xy_px (n, 2) in the undistorted frame;
    covariance (n, 2, 2) px^2; correlation (n,); shared (n,): how many show about the same ground."""

    place: NDArray[np.intp]
    xy_px: Array
    covariance: Array
    correlation: Array
    shared: Array


def map_patches(
    ground: GroundMap, target: Target, places: Places, step_km: Array, side: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Reflectance (k, side, side) of the map around places, rows from north to south, `step_km` (k,) apart, smoothed to
    what an image with pixels of `step_km` resolves; and which patches (k,) are known everywhere."""
    import cv2

    wide = side + 2 * MARGIN
    half = (wide - 1) / 2
    offset = np.stack(np.meshgrid(np.arange(wide) - half, half - np.arange(wide)), axis=-1)
    points = places.moved(target, offset[None] * step_km[:, None, None, None])
    values = ground.values(ground.reflectance, points)
    known = ground.values((ground.reflectance > 0).astype(np.float32), points) > 0.999
    finer = np.minimum(ground.values(ground.resolution_km, places.points) / step_km, 1.0)
    for patch, width in zip(values, SMEARED_PX * np.sqrt(1 - finer**2), strict=True):
        if width > LEAST_SMOOTHING_PX:
            patch[:] = cv2.GaussianBlur(patch, (0, 0), float(width))
    inner = (slice(None), slice(MARGIN, -MARGIN), slice(MARGIN, -MARGIN))
    return values[inner], np.asarray(known[inner].all(axis=(1, 2)))


def match_to_map(
    view: View, ground: GroundMap, places: Places, others: Array, settings: ControlSettings
) -> MapTies | None:
    """Where the image shows places of the map of all images; None where fewer than three match.

    ground: the map without the image. others (places,): the share of the others in the weight of the whole map. With
    d the displacements of the ground in the images and w their shares, the match finds d_i - sum(w_j d_j) / (1 - w_i)
    over the others; times (1 - w_i) that is the displacement from the map of all, which all images have in common."""
    resolution = places_seen([view], places, settings)[0]
    chosen = np.flatnonzero(np.isfinite(resolution) & (others > 0))
    if len(chosen) < FEWEST_PATCHES:
        return None
    at, step = places.part(chosen), np.maximum(resolution[chosen], ground.pixel_km)
    side, margin = settings.patch_px, settings.search_px
    first, known = map_patches(ground, view.target, at, step, side)
    second, whole = patches_of(view, at, step, side + 2 * margin, find_law(settings.law))
    both = np.flatnonzero(known & whole)
    if len(both) < FEWEST_PATCHES:
        return None
    matches = match_patches(first[both], second[both], margin)
    good = matches.good & (matches.correlation >= settings.least_correlation)
    if good.sum() < FEWEST_PATCHES:
        return None
    at, step, chosen = at.part(both[good]), step[both[good]], chosen[both[good]]
    size = step[:, None] * np.array([1.0, -1.0]) * others[chosen, None]  # rows go down, north goes up
    xy = pixels_of_points(view.pose, view.camera, at.moved(view.target, matches.shift[good] * size))
    covariance = pixel_covariances(view, at, size, matches.covariance[good])
    ground_km2 = 4 * np.pi * view.target.mean_radius_km**2 / settings.points
    shared = np.maximum((settings.patch_px * step) ** 2 / ground_km2, 1.0)
    return MapTies(chosen, xy, covariance, matches.correlation[good], shared)
