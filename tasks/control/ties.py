"""Tie points: ground that several images show, and where each shows it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.control.matching import match_patches
from tasks.control.patches import Places, patches_of, places_on
from tasks.control.settings import ControlSettings
from tasks.mosaic.view import Ground, View, seen_from
from tasks.photometry.laws import find_law
from tasks.project.points import pixels_of_points

Array = NDArray[np.float64]
LEAST_SIGMA_PX = 0.03  # OpenCV's remap rounds places to 1/32 px; resampling of coarse images adds as much
REFERENCE_SIGMA_PX = 0.03


@dataclass(frozen=True)
class Ties:
    """n measures of m points. points (m, 3) km: a priori; image, point (n,): which; xy_px (n, 2): pixels of the
    undistorted frame; covariance (n, 2, 2) px^2; correlation (n,): 1 of the image that the others were matched with,
    which `reference` (n,) marks. shared (n,): how many measures of an image show about the same ground, as patches
    overlap: together they count as one."""

    points: Array
    image: NDArray[np.intp]
    point: NDArray[np.intp]
    xy_px: Array
    covariance: Array
    correlation: Array
    reference: NDArray[np.bool_]
    shared: Array

    def part(self, kept: NDArray[np.bool_]) -> "Ties":
        """Some measures; points that fewer than two images show are left out, the others numbered anew."""
        count = np.bincount(self.point[kept], minlength=len(self.points))
        kept = kept & (count >= 2)[self.point]
        used, point = np.unique(self.point[kept], return_inverse=True)
        names = ("image", "xy_px", "covariance", "correlation", "reference", "shared")
        return Ties(self.points[used], point=point, **{name: getattr(self, name)[kept] for name in names})


@dataclass(frozen=True)
class _Matched:
    """Fields of `Ties`; place (n,): number of the place that was tried."""

    image: NDArray[np.intp]
    place: NDArray[np.intp]
    xy_px: Array
    covariance: Array
    correlation: Array
    shared: Array


_NONE = _Matched(
    np.empty(0, np.intp), np.empty(0, np.intp), np.empty((0, 2)), np.empty((0, 2, 2)), np.empty(0), np.empty(0)
)


def find_ties(views: Sequence[View], settings: ControlSettings) -> Ties:
    """Match patches around evenly spread places: in each, every image with the one that shows it best. Poses need to be
    right within `search_px` pixels of the coarser image."""
    places = places_on(views[0].target, settings.points)
    resolution = places_seen(views, places, settings)
    enough = np.isfinite(resolution).sum(axis=0) >= 2
    best = np.argmin(np.where(np.isfinite(resolution), resolution, np.inf), axis=0)
    chosen = {int(reference): np.flatnonzero(enough & (best == reference)) for reference in np.unique(best[enough])}
    found = [
        _of_pair(views, reference, other, mine, places, resolution, settings)
        for reference, mine in chosen.items()
        for other in range(len(views))
        if other != reference
    ]
    found = [part for part in found if len(part.image)] or [_NONE]
    names = ("image", "place", "xy_px", "covariance", "correlation", "shared")
    return _with_references(views, places, best, _Matched(*(_joined(found, name) for name in names)))


def places_seen(views: Sequence[View], places: Places, settings: ControlSettings) -> Array:
    """How images see places (images, places): size of a pixel on the ground, km, NaN where a place is not lit, seen, or
    within the frame and the limits of the angles."""
    resolution = np.full((len(views), len(places.points)), np.nan)
    ground = Ground(places.points, np.cross(places.east, places.north))
    for row, view in zip(resolution, views, strict=True):
        with np.errstate(invalid="ignore"):
            seen = seen_from(view.pose, view.camera, ground)
            xy = seen.xy_px - np.asarray(view.corner_px)
            shown = (seen.mu0 > np.cos(np.radians(settings.max_incidence_deg))) & (
                seen.mu > np.cos(np.radians(settings.max_emission_deg))
            )
            shown &= (xy > 0).all(axis=-1) & (xy < np.array(view.image.shape[::-1]) - 1).all(axis=-1)
        row[shown] = seen.resolution_km[shown]
    return resolution


def _of_pair(
    views: Sequence[View], reference: int, other: int, chosen: NDArray[np.intp], places: Places, resolution: Array,
    settings: ControlSettings,
) -> _Matched:  # fmt: skip
    """The matches of one image with another."""
    fine, coarse = resolution[reference, chosen], resolution[other, chosen]
    with np.errstate(invalid="ignore"):
        chosen = chosen[np.isfinite(coarse) & (coarse < settings.most_ratio * fine)]
    if not len(chosen):
        return _NONE
    step = resolution[other, chosen]
    law, side, margin = find_law(settings.law), settings.patch_px, settings.search_px
    first, whole = patches_of(views[reference], places.part(chosen), step, side, law)
    second, wider = patches_of(views[other], places.part(chosen), step, side + 2 * margin, law)
    both = whole & wider
    if not both.any():
        return _NONE
    chosen, step = chosen[both], step[both]
    matches = match_patches(first[both], second[both], margin)
    good = matches.good & (matches.correlation >= settings.least_correlation)
    chosen, step = chosen[good], step[good]
    if not len(chosen):
        return _NONE
    at = places.part(chosen)
    view = views[other]
    size = step[:, None] * np.array([1.0, -1.0])  # rows go down, north goes up
    xy = pixels_of_points(view.pose, view.camera, at.moved(view.target, matches.shift[good] * size))
    covariance = pixel_covariances(view, at, size, matches.covariance[good])
    ground_km2 = 4 * np.pi * view.target.mean_radius_km**2 / settings.points
    shared = np.maximum((side * step) ** 2 / ground_km2, 1.0)
    image = np.full(len(chosen), other, np.intp)
    return _Matched(image, chosen, xy, covariance, matches.correlation[good], shared)


def _joined(found: Sequence[_Matched], name: str) -> NDArray:
    return np.concatenate([getattr(part, name) for part in found])


def pixel_covariances(view: View, at: Places, size_km: Array, covariance: Array) -> Array:
    """Covariances (k, 2, 2) of shifts on the ground as those of pixels, with what resampling adds."""
    middle = pixels_of_points(view.pose, view.camera, at.points)
    jacobian = np.empty((len(at.points), 2, 2))
    for k in range(2):
        step = np.zeros((len(at.points), 2))
        step[:, k] = size_km[:, k]
        jacobian[:, :, k] = pixels_of_points(view.pose, view.camera, at.moved(view.target, step)) - middle
    found = jacobian @ covariance @ jacobian.transpose(0, 2, 1)
    return np.asarray(found + LEAST_SIGMA_PX**2 * np.eye(2))


def _with_references(views: Sequence[View], places: Places, best: NDArray[np.intp], found: _Matched) -> Ties:
    used = np.unique(found.place)
    own = np.array(
        [pixels_of_points(views[best[p]].pose, views[best[p]].camera, places.points[p]) for p in used]
    ).reshape(-1, 2)
    count = len(used)
    return Ties(
        points=places.points[used],
        image=np.concatenate([found.image, best[used]]),
        point=np.concatenate([np.searchsorted(used, found.place), np.arange(count)]),
        xy_px=np.concatenate([found.xy_px, own]),
        covariance=np.concatenate([found.covariance, np.tile(REFERENCE_SIGMA_PX**2 * np.eye(2), (count, 1, 1))]),
        correlation=np.concatenate([found.correlation, np.ones(count)]),
        reference=np.concatenate([np.zeros(len(found.image), bool), np.ones(count, bool)]),
        shared=np.concatenate([found.shared, np.ones(count)]),
    )
