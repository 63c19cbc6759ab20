"""Where all images show places of the map that they make together, as ties of a bundle adjustment."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tasks.control.patches import Places
from tasks.control.settings import ControlSettings
from tasks.control.ties import Ties
from tasks.improve.map_patches import GroundMap, MapTies, match_to_map
from tasks.improve.sums import Projector, Sums, left_edge_deg
from tasks.mosaic.grid import MosaicGrid
from tasks.mosaic.view import View


def ground_from(sums: Sums, grid: MosaicGrid) -> GroundMap:
    """A mosaic as the ground of patches."""
    with np.errstate(invalid="ignore", divide="ignore"):
        reflectance, resolution = (
            np.where(sums.shown, part / sums.weight, 0).astype(np.float32) for part in (sums.value, sums.coarseness)
        )
    return GroundMap(reflectance, resolution, left_edge_deg(grid), grid.pixel_km)


def map_ties(
    views: Sequence[View], projector: Projector, sums: Sums, places: Places, settings: ControlSettings
) -> Ties:
    """Match every image with the map that the others make. sums: of all views."""
    found: list[tuple[int, MapTies]] = []
    whole = ground_from(sums, projector.grid)
    total = whole.values(sums.weight.astype(np.float32), places.points)
    for number in range(len(views)):
        view = views[number]
        rest = projector.without(sums, number, view)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = whole.values(rest.weight.astype(np.float32), places.points) / total
        others = np.clip(np.nan_to_num(share), 0.0, 1.0)
        ties = match_to_map(view, ground_from(rest, projector.grid), places, others, settings)
        if ties is not None:
            found.append((number, ties))
    return _ties_of(found, places)


def _ties_of(found: Sequence[tuple[int, MapTies]], places: Places) -> Ties:
    def joined(name: str, empty: NDArray) -> NDArray:
        return np.concatenate([empty, *(getattr(ties, name) for _, ties in found)])

    image = np.concatenate([np.empty(0, np.intp), *(np.full(len(ties.place), number) for number, ties in found)])
    place = joined("place", np.empty(0, np.intp))
    every = Ties(
        points=places.points,
        image=image.astype(np.intp),
        point=place,
        xy_px=joined("xy_px", np.empty((0, 2))),
        covariance=joined("covariance", np.empty((0, 2, 2))),
        correlation=joined("correlation", np.empty(0)),
        reference=np.zeros(len(place), bool),
        shared=joined("shared", np.empty(0)),
    )
    return every.part(np.ones(len(place), bool))
