"""Robust least squares of the brightness, and the correlation that judges it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.errors import FailedError
from tasks.compare.brightness import brightness_columns, correlation, robust_least_squares

RNG = np.random.default_rng(0)
COLUMNS = brightness_columns(RNG.random((2, 30, 40)).astype(np.float32))
TRUE = np.array([120.0, -30.0, 7.0])
ONES = np.ones((30, 40), np.float32)


def picture(noise: float = 0.0, seed: int = 1) -> np.ndarray:
    clean = np.tensordot(TRUE, COLUMNS, 1)
    return (clean + noise * np.random.default_rng(seed).standard_normal(clean.shape)).astype(np.float32)


def test_the_columns_are_the_bases_and_a_constant_background() -> None:
    assert COLUMNS.shape == (3, 30, 40)
    assert (COLUMNS[-1] == 1).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.floats(0, 5))
def test_without_outliers_it_is_ordinary_weighted_least_squares(seed: int, noise: float) -> None:
    image = picture(noise, seed)
    weight = np.random.default_rng(seed).uniform(0.5, 1.5, image.shape).astype(np.float32)
    found, covariance, chi_square = robust_least_squares(COLUMNS, image, weight, rounds=1)
    root = np.sqrt(weight.ravel())
    design = COLUMNS.reshape(3, -1).T * root[:, None]
    expected, *_ = np.linalg.lstsq(design, image.ravel() * root, rcond=None)
    assert found == pytest.approx(expected, abs=1e-3)
    assert chi_square == pytest.approx(noise**2, rel=0.15, abs=1e-3)
    normal = np.linalg.inv(design.T @ design) * chi_square
    assert covariance == pytest.approx(normal, rel=1e-2, abs=1e-3 * float(normal.max()) + 1e-12)


def test_the_covariance_is_the_scatter_of_the_solutions() -> None:
    solutions = np.array([robust_least_squares(COLUMNS, picture(3.0, seed), ONES)[0] for seed in range(150)])
    _, covariance, _ = robust_least_squares(COLUMNS, picture(3.0), ONES)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(solutions.std(axis=0), rel=0.25)
    assert solutions.mean(axis=0) == pytest.approx(TRUE, abs=0.1)


@pytest.mark.parametrize("outlier", [1e4, -1e4])
def test_outliers_hardly_matter(outlier: float) -> None:
    image = picture(1.0)
    image[RNG.random(image.shape) < 0.02] = outlier
    robust, _, _ = robust_least_squares(COLUMNS, image, ONES, rounds=6)
    plain, _, _ = robust_least_squares(COLUMNS, image, ONES, rounds=1)
    assert np.abs(robust - TRUE).max() < 0.5 < 0.1 * np.abs(plain - TRUE).max()


def test_pixels_without_weight_may_hold_anything() -> None:
    image, weight = picture(1.0), ONES.copy()
    expected, _, _ = robust_least_squares(COLUMNS, image, np.where(np.indices(ONES.shape)[0] < 5, 0, weight))
    image[:5] = np.nan
    weight[:5] = 0
    assert robust_least_squares(COLUMNS, image, weight)[0] == pytest.approx(expected)


def test_bases_that_depend_on_each_other_are_no_trouble() -> None:
    twice = np.concatenate([COLUMNS, COLUMNS[:1]])
    found, covariance, _ = robust_least_squares(twice, picture(), ONES)
    assert np.tensordot(found, twice, 1) == pytest.approx(picture(), abs=1e-2)
    assert np.isfinite(covariance).all()


def test_too_few_pixels_fail_by_name() -> None:
    weight = np.zeros_like(ONES)
    weight[0, :3] = 1
    with pytest.raises(FailedError) as failure:
        robust_least_squares(COLUMNS, picture(), weight)
    assert failure.value.code == "no-usable-pixels"


def test_correlation_is_pearsons() -> None:
    a, b = picture(20.0), picture()
    everywhere = np.ones(a.shape, bool)
    assert correlation(a, b, everywhere) == pytest.approx(np.corrcoef(a.ravel(), b.ravel())[0, 1])
    assert correlation(3 * b + 5, 3 * b + 5, everywhere) == pytest.approx(1)
    assert correlation(np.ones_like(b), b, everywhere) == 0
    assert correlation(b, b, ~everywhere) == 0


def test_a_few_cosmic_rays_do_not_decide_the_correlation() -> None:
    a, b = picture(1.0), picture()
    hit = a.copy()
    hit[3, 5] = hit[17, 20] = 1e5
    everywhere = np.ones(a.shape, bool)
    assert correlation(hit, b, everywhere) > 0.95
    assert np.corrcoef(hit.ravel(), b.ravel())[0, 1] < 0.1


@pytest.mark.parametrize("size", [0.0, 1e-30, 1e-20, 1e-12])
def test_a_column_that_vanishes_tells_nothing(size: float) -> None:
    """The best weight of a basis that is 1e-30 on usable pixels may be 1e30, and overflow elsewhere."""
    rng = np.random.default_rng(7)
    seen = rng.random((20, 20)).astype(np.float32)
    faint = (size * rng.random((20, 20))).astype(np.float32)
    image = 3 * seen + 2 + rng.normal(0, 0.01, seen.shape).astype(np.float32)
    columns = np.stack([seen, faint, np.ones_like(seen)])
    solution, covariance, _ = robust_least_squares(columns, image, np.ones_like(seen))
    assert solution[[0, 2]] == pytest.approx([3, 2], abs=0.01)
    assert solution[1] == 0
    assert np.isfinite(covariance).all()
