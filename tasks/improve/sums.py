"""Weighted sums of all images over a whole map, so that the map without one of them is at hand."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.mosaic.block import Share, share_of
from tasks.mosaic.grid import Block, MosaicGrid
from tasks.mosaic.model import Model
from tasks.mosaic.settings import MosaicSettings
from tasks.mosaic.view import View, ground_at

Array = NDArray[np.float64]
STRIP_PX = 1_000_000  # pixels of the map that are made at once
# Less weight than this share of the largest is rounding of what was taken away again.
LEAST_SHARE = 1e-9


@dataclass
class Sums:
    """Sums (rows, columns) over images: weight; weight times reflectance; weight times the size of a pixel on the
    ground, km; square of weight times 1-sigma; how many images there are."""

    weight: Array
    value: Array
    coarseness: Array
    square: Array
    count: NDArray[np.int16]

    @classmethod
    def empty(cls, shape: tuple[int, int]) -> "Sums":
        """Of no image."""
        zeros = [np.zeros(shape) for _ in range(4)]
        return cls(zeros[0], zeros[1], zeros[2], zeros[3], np.zeros(shape, np.int16))

    def add(self, rows: slice, share: Share, good: NDArray[np.bool_]) -> None:
        """Count what an image adds to a strip of rows, where it is good (n,)."""
        where, weight = share.where[good], share.weight[good]
        sigma = np.sqrt(share.noise**2 + share.pose**2 + share.photometry**2)[good]
        self.weight[rows].ravel()[where] += weight
        self.value[rows].ravel()[where] += weight * share.value[good]
        self.coarseness[rows].ravel()[where] += weight * share.resolution_km[good]
        self.square[rows].ravel()[where] += (weight * sigma) ** 2
        self.count[rows].ravel()[where] += 1

    @property
    def shown(self) -> NDArray[np.bool_]:
        """Where any image shows the ground."""
        return self.weight > LEAST_SHARE * max(float(self.weight.max()), 1e-300)

    @property
    def reflectance(self) -> NDArray[np.float32]:
        """Weighted mean (rows, columns), NaN where no image shows the ground."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.shown, self.value / self.weight, np.nan).astype(np.float32)

    @property
    def sigma(self) -> NDArray[np.float32]:
        """1-sigma of the reflectance."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.shown, np.sqrt(self.square) / self.weight, np.nan).astype(np.float32)


class Projector:
    """Images on the grid of a map, with the law and levels of a mosaic. expected: reflectance (rows, columns) of an
    earlier map; values that differ from it by more than `outlier_sigma` are left out."""

    def __init__(
        self, grid: MosaicGrid, model: Model, settings: MosaicSettings, expected: NDArray[np.float32] | None = None
    ) -> None:
        self.grid, self.model, self.settings, self.expected = grid, model, settings, expected

    def expecting(self, expected: NDArray[np.float32]) -> "Projector":
        """The same for another earlier map."""
        return Projector(self.grid, self.model, self.settings, expected)

    def strips(self) -> list[Block]:
        """The map in strips of rows."""
        rows, columns = self.grid.shape
        step = max(1, STRIP_PX // columns)
        return [(slice(top, min(top + step, rows)), slice(0, columns)) for top in range(0, rows, step)]

    def summed(self, views: Sequence[View]) -> Sums:
        """The sums of all views."""
        sums = Sums.empty(self.grid.shape)
        for block in self.strips():
            ground = ground_at(views[0].target, *self.grid.places(block))
            for number in range(len(views)):
                view = views[number]
                share = share_of(number, view, ground, self.model, self.settings, self.grid.pixel_km)
                if share is not None:
                    sums.add(block[0], share, self._good(share, block))
        return sums

    def without(self, sums: Sums, number: int, view: View) -> Sums:
        """The sums of all views but this one (the other planes, of count and sigma, stay those of all)."""
        weight, value, coarseness = sums.weight.copy(), sums.value.copy(), sums.coarseness.copy()
        for block in self.strips():
            ground = ground_at(view.target, *self.grid.places(block))
            share = share_of(number, view, ground, self.model, self.settings, self.grid.pixel_km)
            if share is None:
                continue
            good = self._good(share, block)
            where, own = share.where[good], share.weight[good]
            weight[block[0]].ravel()[where] -= own
            value[block[0]].ravel()[where] -= own * share.value[good]
            coarseness[block[0]].ravel()[where] -= own * share.resolution_km[good]
        alone = weight <= LEAST_SHARE * sums.weight.max()
        weight[alone] = value[alone] = coarseness[alone] = 0
        return Sums(weight, value, coarseness, sums.square, sums.count)

    def _good(self, share: Share, block: Block) -> NDArray[np.bool_]:
        if self.expected is None:
            return np.ones(len(share.where), bool)
        sigma = np.sqrt(share.noise**2 + share.pose**2 + share.photometry**2)
        with np.errstate(invalid="ignore"):
            off = np.abs(share.value - self.expected[block[0]].ravel()[share.where])
            return np.asarray(~(off > self.settings.outlier_sigma * sigma))  # NaN: nothing is expected there


def left_edge_deg(grid: MosaicGrid) -> float:
    """East longitude of the left edge of an equirectangular map."""
    return float(grid.longitude()[0]) - 90 / grid.shape[0]
