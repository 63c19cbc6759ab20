"""The disk cut into tiles, each with a gain of its own, for what maps and photometric laws get wrong.

Errors of a map and of a law are multiplicative and smooth, and far larger than noise. A gain and two slopes in every
tile, known beforehand to some ten per cent, take them up; what is left for the pose is the limb's edge and the
markings inside the tiles. Along the limb the tiles are sectors, so that no segment's brightness moves its edge.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.joint.settings import TileSettings

LOCAL = 3


@dataclass(frozen=True)
class Tiles:
    """label: (ny, nx) number of each pixel's tile, -1 outside all; count of tiles; along, across: (ny, nx) place within
    the tile, about -1 to 1."""

    label: NDArray[np.int32]
    count: int
    along: NDArray[np.float32]
    across: NDArray[np.float32]


def tiles_of(shape: tuple[int, int], centre_px: NDArray, radius_px: float, settings: TileSettings) -> Tiles:
    """Squares inside the disk, sectors of a ring of `limb_px` on either side of the limb (`limb_share` of the radius
    where that is more)."""
    side = max(settings.side_px, settings.side_share * radius_px)
    inner = radius_px - max(settings.limb_px, settings.limb_share * radius_px)
    outer = radius_px + settings.limb_px
    y, x = np.indices(shape, dtype=np.float32)
    x -= np.float32(centre_px[0])
    y -= np.float32(centre_px[1])
    r = np.hypot(x, y)
    turn = np.arctan2(y, x) / (2 * np.pi) + 0.5
    sectors = max(round(2 * np.pi * radius_px / side), 8)
    sector = np.minimum((turn * sectors).astype(np.int32), sectors - 1)
    squares = int(np.ceil(2 * radius_px / side))
    column, row = (np.clip(np.floor((v + radius_px) / side), 0, squares - 1).astype(np.int32) for v in (x, y))
    ring = (r >= inner) & (r < outer)
    label = np.where(ring, sector, np.where(r < inner, sectors + row * squares + column, -1)).astype(np.int32)
    along = np.where(ring, 2 * (turn * sectors - sector) - 1, 2 * ((x + radius_px) / side - column) - 1)
    middle, half = (inner + radius_px) / 2, max((radius_px - inner) / 2, 1.0)
    across = np.where(ring, np.clip((r - middle) / half, -1.5, 1.5), 2 * ((y + radius_px) / side - row) - 1)
    return Tiles(label, sectors + squares**2, along.astype(np.float32), across.astype(np.float32))
