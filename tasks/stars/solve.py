"""From a frame's star images to the camera's orientation: by a predicted orientation, in a cone, or over the whole sky;
or that there is none."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.stars.source import Cone
from catalog.stars.table import StarTable
from tasks.stars.identify import Hypothesis, Possible, chance_of, hypotheses, sky_pairs
from tasks.stars.match import Matched, Measured, match_stars
from tasks.stars.settings import IdentificationSettings

Array = NDArray[np.float64]
PREDICTED, CONE, BLIND = "predicted", "cone", "blind"
PROMISING = 1e-2  # false-alarm probability of the first search below which all detections are looked at
# Fitting three angles to the matches picks the best of about this many orientations within the first search's error.
WITHIN_FIRST_SEARCH = 10.0
CELLS_ACROSS = 2
SHORTER_BLIND = 0.5  # pairs over the whole sky are made up to this share of the frame's diagonal


@dataclass(frozen=True)
class Region:
    """Where the camera may look. kind: predicted, cone or blind. cone: what the boresight may be in; predicted:
    camera_from_j2000 that it is near to, within the cone's radius."""

    kind: str
    cone: Cone | None = None
    predicted: Array | None = None

    def wider(self, by_deg: float) -> Cone | None:
        """The cone of all that a frame of this half diagonal may see."""
        return None if self.cone is None else Cone(self.cone.axis, min(self.cone.radius_deg + by_deg, 180.0))

    @property
    def possible(self) -> Possible:
        """Test of an orientation."""
        if self.cone is None:
            return Possible()
        return Possible(np.radians(self.cone.radius_deg), self.cone.axis, self.predicted)


@dataclass(frozen=True)
class Lock:
    """Identified stars. table, directions: catalog stars in question and where they are seen (n, 3); matched: which of
    them, and the orientation. false_alarm: probability that chance does as much. kind: of the region."""

    table: StarTable
    directions: Array
    matched: Matched
    false_alarm: float
    kind: str


Apparent = Callable[[StarTable], Array]
StarsIn = Callable[[Cone | None], StarTable]


def solve(
    camera: Camera,
    seen: Measured,
    sure: NDArray[np.bool_],
    regions: Sequence[Region],
    stars_in: StarsIn,
    apparent: Apparent,
    settings: IdentificationSettings,
) -> tuple[Lock | None, float]:
    """The first region's lock, in their order; None with the least false-alarm probability that was reached.

    seen: detections, brightest first; sure: (n,) those that the search is made with, the others may only join in."""
    rays = camera.ray(seen.xy_px[sure][: settings.brightest])
    tried, least = 0, 1.0
    if len(rays) < settings.least_stars:
        return None, least
    search = Search(camera, seen, sure, stars_in, apparent, settings)
    for region in regions:
        before = tried
        for found in search.hypotheses(rays, region):
            tried = before + found.tried
            false_alarm = min(1.0, found.chance * max(tried, 1))
            least = min(least, false_alarm)
            if found.matches >= settings.least_stars and false_alarm < PROMISING:
                lock = search.refined(region, found, tried)
                least = min(least, lock.false_alarm) if lock else least
                if lock is not None and lock.false_alarm <= settings.largest_false_alarm:
                    return lock, lock.false_alarm
            if tried > settings.most_orientations:
                break
    return None, least


def half_diagonal_deg(camera: Camera) -> float:
    """Angle from the boresight to the frame's farthest corner."""
    nx, ny = camera.size_px
    corners = camera.ray([[0, 0], [nx - 1, 0], [0, ny - 1], [nx - 1, ny - 1]])
    return float(np.degrees(np.arccos(corners[:, 2].min())))


@dataclass(frozen=True)
class Search:
    """What a search is made with: see `solve`."""

    camera: Camera
    seen: Measured
    sure: NDArray[np.bool_]
    stars_in: StarsIn
    apparent: Apparent
    settings: IdentificationSettings

    def hypotheses(self, rays: Array, region: Region) -> Iterator[Hypothesis]:
        """Orientations in a region that pairs of detections make, with the brighter catalog stars."""
        camera, settings = self.camera, self.settings
        table = self.stars_in(region.wider(half_diagonal_deg(camera)))
        directions = self.apparent(table)
        spread = _widest(rays)
        bright = brightest_everywhere(directions, spread / np.sqrt(2), settings.stars_in_frame)
        pairs = sky_pairs(directions[bright], spread * (SHORTER_BLIND if region.cone is None else 1.05))
        tolerance = settings.tolerance_px / camera.focal_length_px
        least = max(10 * tolerance, 0.05 * spread)
        yield from hypotheses(rays, pairs, tolerance, 2 * camera.focal_length_sigma, least, region.possible)

    def refined(self, region: Region, found: Hypothesis, tried: int) -> Lock | None:
        """All detections against all catalog stars in the frame; None where too few agree, or outside the region."""
        camera, seen, settings = self.camera, self.seen, self.settings
        table = self.stars_in(Cone(found.camera_from_sky[2], half_diagonal_deg(camera) * 1.05))
        directions, radius_px = self.apparent(table), 1.5 * settings.tolerance_px
        matched = match_stars(
            camera, found.camera_from_sky, directions, table.magnitude, seen, radius_px, settings.least_stars
        )
        if matched is None or not region.possible(matched.orientation.camera_from_j2000[None])[0]:
            return None
        among = self.sure[matched.detection]
        if among.sum() < settings.least_stars:
            return None
        faintest = np.nanmax(table.magnitude[matched.star[among]]) + 0.5
        density = expected_per_px2(camera, matched, directions[~(table.magnitude > faintest)], seen)
        probability = density * np.pi * matched.radius_px**2
        chance = chance_of(int(among.sum()) - 2, int(self.sure.sum()) - 2, probability)
        return Lock(table, directions, matched, min(1.0, chance * WITHIN_FIRST_SEARCH * tried), region.kind)


def _widest(rays: Array) -> float:
    return float(np.arccos(np.clip((rays @ rays.T).min(), -1, 1)))


def brightest_everywhere(directions: Array, across_rad: float, wanted: float) -> NDArray[np.int_]:
    """Numbers of the stars, given brightest first, that are among the brightest of their part of the sky: `wanted` of
    them in each square `across_rad` wide, in the Milky Way as at its poles. A frame of that size shows its own
    brightest, wherever it looks."""
    cell = across_rad / CELLS_ACROSS
    declination = np.arcsin(np.clip(directions[:, 2], -1, 1))
    row = np.floor((declination + np.pi / 2) / cell).astype(np.int64)
    circle = 2 * np.pi * np.cos(np.minimum(np.abs((row + 0.5) * cell - np.pi / 2), np.pi / 2))
    columns = np.maximum(1, np.round(circle / cell)).astype(np.int64)
    longitude = np.arctan2(directions[:, 1], directions[:, 0]) % (2 * np.pi)
    column = np.minimum((longitude / (2 * np.pi) * columns).astype(np.int64), columns - 1)
    key = row * (int(2 * np.pi / cell) + 2) + column
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    rank = np.arange(len(order)) - np.repeat(first, np.diff(np.append(first, len(order))))
    return np.sort(order[rank < max(1, round(wanted / CELLS_ACROSS**2))])


def expected_per_px2(camera: Camera, matched: Matched, directions: Array, seen: Measured) -> float:
    """Catalog stars per square pixel of the part of the frame that detections lie in."""
    places = camera.project(directions @ matched.orientation.camera_from_j2000.T)
    low, high = seen.xy_px.min(axis=0), seen.xy_px.max(axis=0)
    inside = ((places >= low) & (places <= high)).all(axis=1)
    return max(int(inside.sum()), 1) / max(float(np.prod(high - low)), 1.0)
