"""A map moved north and east."""

import numpy as np
import pytest

from catalog.basemap import BaseMap
from tasks.geometry.bilinear import map_values


@pytest.mark.parametrize(("north_deg", "east_deg"), [(0.0, 0.3), (1.5, 0.0), (-0.7, -0.4), (2.25, 181.0)])
def test_what_a_moved_map_shows_lies_north_and_east_of_where_it_was(north_deg: float, east_deg: float) -> None:
    latitude = 90 - (np.arange(360) + 0.5) / 2
    longitude = (np.arange(720) + 0.5) / 2
    waves = 2 + np.sin(np.radians(3 * latitude))[:, None] * np.cos(np.radians(5 * longitude))
    there = BaseMap("waves", waves.astype(np.float32), 0.0, "waves")
    moved = there.moved(north_deg, east_deg)
    at_lat, at_lon = np.array([-60.3, -1.2, 20.0, 71.7]), np.array([3.1, 120.0, 359.9, 200.4])
    here = map_values(moved.albedo, moved.left_edge_deg, at_lat, at_lon)
    assert here == pytest.approx(map_values(there.albedo, 0.0, at_lat - north_deg, at_lon - east_deg), abs=1e-3)
    assert moved.albedo.shape == there.albedo.shape
    assert np.isfinite(moved.albedo).all()
