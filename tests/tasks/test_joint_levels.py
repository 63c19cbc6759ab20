"""Grey levels farther apart than the noise displace edges; others do not."""

import numpy as np
import pytest

from tasks.joint.linearity import displaced_by_levels


def picture(bits: float, noise: float = 1.0) -> np.ndarray:
    random = np.random.default_rng(2)
    smooth = 200 * np.linspace(0, 1, 4000) + random.normal(size=4000) * noise
    step = 256 / 2**bits
    return np.round(smooth / step) * step


def test_half_a_level_over_the_slope_of_the_edge() -> None:
    found = displaced_by_levels(picture(4), 1.0, 200.0, 1.0)
    assert found == pytest.approx(8 / 200 * np.sqrt(2 * np.pi), rel=0.08)
    assert displaced_by_levels(picture(4), 1.0, 200.0, 2.0) == pytest.approx(2 * found)
    assert displaced_by_levels(picture(4), 16.0, 200.0, 1.0) < 1e-6


@pytest.mark.parametrize("bits", [8, 12])
def test_levels_within_the_noise_do_nothing(bits: float) -> None:
    assert displaced_by_levels(picture(bits), 1.0, 200.0, 1.0) < 1e-6


def test_values_that_were_resampled_and_empty_pictures_are_on_no_levels() -> None:
    mixed = picture(4)[:-1] * 0.37 + picture(4)[1:] * np.linspace(0, 1, 3999)
    assert displaced_by_levels(mixed, 0.5, 200.0, 1.0) < 2e-3
    assert displaced_by_levels(np.zeros(10), 0.5, 1.0, 1.0) == 0
