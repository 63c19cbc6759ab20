"""The disk cut into tiles, each with a gain of its own, for what maps and photometric laws get wrong.

Errors of a map and of a law are multiplicative and smooth, and far larger than noise. A gain and two slopes in every
tile, known beforehand to some ten per cent, take them up; what is left for the pose is the limb's edge and the
markings inside the tiles. Scattered light, and what a vidicon adds to it, differs from one side of the disk to the
other, and is a level of its own in every tile. Along the limb the tiles are sectors, so that no segment's brightness
moves its edge.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tasks.joint.settings import TileSettings

# Unknowns of a tile: gain and its two slopes, and light scattered into it.
GAINS, LOCAL = 3, 4


@dataclass(frozen=True)
class Tiles:
    """label: (ny, nx) number of each pixel's tile, -1 outside all; count of tiles, the first `sectors` of them along
    the limb, cut by `layout` about a disk of centre_px (2,) and radius_px; along, across: (ny, nx) place within the
    tile, about -1 to 1."""

    label: NDArray[np.int32]
    count: int
    sectors: int
    layout: "Layout"
    centre_px: NDArray[np.float64]
    radius_px: float
    along: NDArray[np.float32]
    across: NDArray[np.float32]

    @cached_property
    def order(self) -> NDArray[np.int64]:
        """Pixels (ny * nx,) one tile after the other, those outside all first."""
        return np.argsort(self.label.ravel(), kind="stable")

    @cached_property
    def ends(self) -> NDArray[np.int64]:
        """Where, in that order, the pixels outside all tiles end, and those of each tile (1 + count,)."""
        return np.cumsum(np.bincount(self.label.ravel() + 1, minlength=self.count + 1))

    def neighbourhoods(self, size: int) -> NDArray[np.int32]:
        """Number (ny, nx) of the group of `size` sectors or `size` x `size` squares that a pixel is in, -1 outside
        all."""
        sectors, squares = self.sectors, self.layout.squares
        square = np.maximum(self.label - sectors, 0)
        group = sectors + square // squares // size * squares + square % squares // size
        inside = np.where(self.label < sectors, self.label // size, group)
        return np.where(self.label < 0, -1, inside).astype(np.int32)

    def away_px(self, other: "Tiles") -> float:
        """How far the limbs lie apart about which the two were cut."""
        return float(np.hypot(*(self.centre_px - other.centre_px)) + abs(self.radius_px - other.radius_px))


@dataclass(frozen=True)
class Layout:
    """How a disk of about one radius is cut: the tiles' side, the ring's inner and outer half-width, pixels, and how
    many sectors and squares (per side). Kept while the disk moves and grows, so that tiles stay comparable."""

    side_px: float
    inner_px: float
    outer_px: float
    sectors: int
    squares: int


def layout_for(radius_px: float, settings: TileSettings) -> Layout:
    """Squares inside the disk, sectors of a ring along the limb (see `TileSettings`)."""
    side = max(settings.side_px, settings.side_share * radius_px)
    inner = max(settings.limb_px, settings.limb_share * radius_px)
    sectors = max(round(2 * np.pi * radius_px / side), 8)
    return Layout(side, inner, settings.limb_px, sectors, int(np.ceil(2 * radius_px / side)) + 1)


def tiles_of(shape: tuple[int, int], centre_px: NDArray, radius_px: float, layout: Layout) -> Tiles:
    """The tiles (ny, nx) of a disk."""
    side, sectors, squares = layout.side_px, layout.sectors, layout.squares
    inner, outer = radius_px - layout.inner_px, radius_px + layout.outer_px
    y, x = np.indices(shape, dtype=np.float32)
    x -= np.float32(centre_px[0])
    y -= np.float32(centre_px[1])
    r = np.hypot(x, y)
    turn = np.arctan2(y, x) / (2 * np.pi) + 0.5
    sector = np.minimum((turn * sectors).astype(np.int32), sectors - 1)
    column, row = (np.clip(np.floor((v + radius_px) / side), 0, squares - 1).astype(np.int32) for v in (x, y))
    ring = (r >= inner) & (r < outer)
    label = np.where(ring, sector, np.where(r < inner, sectors + row * squares + column, -1)).astype(np.int32)
    along = np.where(ring, 2 * (turn * sectors - sector) - 1, 2 * ((x + radius_px) / side - column) - 1)
    middle, half = (inner + radius_px) / 2, max(layout.inner_px / 2, 1.0)
    across = np.where(ring, np.clip((r - middle) / half, -1.5, 1.5), 2 * ((y + radius_px) / side - row) - 1)
    count, places = sectors + squares**2, (along.astype(np.float32), across.astype(np.float32))
    return Tiles(label, count, sectors, layout, np.asarray(centre_px), radius_px, *places)
