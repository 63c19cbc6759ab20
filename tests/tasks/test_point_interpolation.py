"""Displacing an image by a fraction of a pixel."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasks.point.registration.least_squares import catmull_rom, moved


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_slopes_and_parabolas_are_displaced_by_exactly_the_offset(dx: float, dy: float) -> None:
    y, x = np.indices((40, 44), dtype=np.float64)

    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 3 * x - 2 * y + 0.05 * x * x - 0.02 * x * y

    found = moved(surface(x, y).astype(np.float32), np.array([dx, dy]))
    expected = surface(x - dx, y - dy)
    assert found[8:-8, 8:-8] == pytest.approx(expected[8:-8, 8:-8], abs=2e-3)


@given(st.integers(-6, 6), st.integers(-6, 6))
def test_whole_pixels_move_values_unchanged_and_edges_are_replicated(dx: int, dy: int) -> None:
    image = np.random.default_rng(0).random((20, 24)).astype(np.float32)
    rows, columns = np.clip(np.arange(20) - dy, 0, 19), np.clip(np.arange(24) - dx, 0, 23)
    np.testing.assert_array_equal(moved(image, np.array([dx, dy], float)), image[rows[:, None], columns])


@given(st.floats(0, 1, exclude_max=True))
def test_the_weights_sum_to_one_and_their_centre_is_the_place(fraction: float) -> None:
    weights = catmull_rom(fraction)
    assert weights.sum() == pytest.approx(1)
    assert weights @ [-2, -1, 0, 1] == pytest.approx(-fraction, abs=1e-12)


@pytest.mark.parametrize("offset_px", [(0.1, 0.0), (0.0, -0.26), (0.5, 0.5), (2.4, -1.3)])
def test_a_blurred_spot_keeps_its_light_and_moves_by_the_offset(offset_px: tuple[float, float]) -> None:
    y, x = np.indices((40, 40), dtype=np.float64) - 19.3
    spot = np.exp(-(x**2 + y**2) / 2 / 1.0**2).astype(np.float32)
    found = moved(spot, np.array(offset_px))
    centre = np.array([(found * axis).sum() / found.sum() for axis in (x, y)])
    before = np.array([(spot * axis).sum() / spot.sum() for axis in (x, y)])
    assert found.sum() == pytest.approx(spot.sum(), rel=1e-5)
    assert centre - before == pytest.approx(offset_px, abs=1e-4)
