"""How a disk is cut into tiles."""

import numpy as np
import pytest

from tasks.joint.settings import TileSettings
from tasks.joint.tiles import Tiles, layout_for, tiles_of

SETTINGS = TileSettings()


def cut(radius_px: float = 40.0, centre: tuple[float, float] = (60.0, 55.0)) -> Tiles:
    return tiles_of((120, 124), np.array(centre), radius_px, layout_for(radius_px, SETTINGS))


def test_every_pixel_of_the_disk_is_in_one_tile_and_none_outside_the_ring() -> None:
    tiles = cut()
    y, x = np.indices(tiles.label.shape)
    away = np.hypot(x - 60, y - 55)
    assert (tiles.label[away < 40] >= 0).all()
    assert (tiles.label[away > 40 + SETTINGS.limb_px] == -1).all()
    assert tiles.label.max() < tiles.count


def test_the_limb_is_sectors_and_the_inside_squares() -> None:
    tiles = cut()
    y, x = np.indices(tiles.label.shape)
    away = np.hypot(x - 60, y - 55)
    limb = (tiles.label >= 0) & (tiles.label < tiles.sectors)
    assert away[limb].min() >= 40 - max(SETTINGS.limb_px, SETTINGS.limb_share * 40) - 1e-3
    assert set(np.unique(tiles.label[limb])) == set(range(tiles.sectors))
    assert np.abs(tiles.along[tiles.label >= 0]).max() <= 1 + 1e-5
    assert np.abs(tiles.across[tiles.label >= 0]).max() <= 1.5


def test_tiles_move_with_the_disk() -> None:
    here, there = cut(), cut(centre=(64.0, 52.0))
    assert here.away_px(there) == pytest.approx(5.0)
    assert here.away_px(cut(41.0)) == pytest.approx(1.0)
    assert np.array_equal(here.label[20:100, 20:100], there.label[17:97, 24:104])


def test_neighbourhoods_hold_neighbours() -> None:
    tiles = cut()
    groups = tiles.neighbourhoods(2)
    assert (groups[tiles.label < 0] == -1).all()
    for group in np.unique(groups[groups >= 0]):
        assert len(np.unique(tiles.label[groups == group])) <= 4
