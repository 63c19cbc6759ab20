"""Robust statistics: scatter and weights that outliers do not decide."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import median_abs_deviation

from catalog.robust import huber_weight, sigma_about_median, sigma_about_zero


def huber_cost(size: np.ndarray, limit: float) -> np.ndarray:
    """Huber's function: squares up to the limit, lines beyond."""
    return np.where(size <= limit, size**2, limit * (2 * size - limit))


VALUES = np.random.default_rng(3).normal(5.0, 2.0, 20001)


def test_the_scatter_is_scipys_and_that_of_a_normal_distribution() -> None:
    assert sigma_about_median(VALUES) == pytest.approx(median_abs_deviation(VALUES, scale="normal"), rel=1e-12)
    assert sigma_about_median(VALUES) == pytest.approx(2.0, rel=0.03)
    assert sigma_about_zero(VALUES - 5.0) == pytest.approx(2.0, rel=0.03)


@given(st.floats(0, 1e6), st.floats(1e-6, 1e3))
def test_a_weight_is_the_costs_slope_over_that_of_squares(size: float, limit: float) -> None:
    weight = float(huber_weight(np.array([size]), limit)[0])
    assert weight == (1.0 if size <= limit else pytest.approx(limit / size))
    step = 1e-4 * max(size, limit)
    if size > step and not limit - step < size < limit + step:
        up, down = huber_cost(np.array([size + step, size - step]), limit)
        assert (up - down) / (2 * step) == pytest.approx(2 * weight * size, rel=1e-3)


def test_single_precision_stays_single() -> None:
    assert huber_weight(np.ones(3, np.float32), 2.5).dtype == np.float32
    assert (huber_weight(np.zeros(2), np.inf) == 1).all()
