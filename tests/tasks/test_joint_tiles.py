"""How a disk is cut into tiles, and how far their gains may be off."""

from dataclasses import replace

import numpy as np
import pytest
from test_joint_normal_equations import NOISE, problem

from tasks.joint.normal_equations import solve_linear
from tasks.joint.settings import TileSettings
from tasks.joint.tile_prior import first_prior, learned_prior, limb_gain
from tasks.joint.tiles import LOCAL, Tiles, layout_for, tiles_of

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


@pytest.mark.parametrize(("gain", "held"), [(0.2, False), (0.0, True)])
def test_the_spread_of_the_gains_is_learned_and_tiles_that_fit_are_held(gain: float, held: bool) -> None:
    given, _, weight = problem(0.3)
    rng = np.random.default_rng(7)
    tiles, bright = given.tiles, given.columns[0]
    own = np.where(tiles.label >= 0, gain * rng.standard_normal(tiles.count)[tiles.label], 0)
    image = np.tensordot([2.0, 0.0, 0.5], given.columns, 1) + own * bright
    image += NOISE * rng.standard_normal(image.shape)
    before = first_prior(tiles.count, SETTINGS)
    fit = solve_linear(replace(given, image=image.astype(np.float32), local_prior=before), weight)
    inside = learned_prior(fit, before, tiles.sectors, SETTINGS)[-1, 0] ** -0.5
    print(f"gains of {gain}: believed to {inside:.4f}")
    assert (inside <= 2 * SETTINGS.smallest) if held else (gain < inside <= SETTINGS.gain + 1e-9)
    seen = limb_gain(fit, before, tiles.sectors, SETTINGS)
    assert seen == pytest.approx(gain, rel=0.5, abs=0.02)
    assert before.shape == (tiles.count, LOCAL)
