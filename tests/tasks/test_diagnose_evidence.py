"""When one explanation counts as better than another one, and as better than chance."""

import cv2
import numpy as np
import pytest
from scipy.special import ndtri

from tasks.diagnose import DiagnoseSettings
from tasks.diagnose.evidence import Fit, better_by, better_than_sky, shared

SETTINGS = DiagnoseSettings()
SHAPE = (96, 96)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]]
DISK = np.hypot(X - 48, Y - 48) < 30
# Sigmas, and logarithm of a likelihood, that one of 60 candidates must reach.
SIGMAS, GAIN = -float(ndtri(SETTINGS.false_alarm / 60)), float(np.log(60 / SETTINGS.false_alarm))


def noise(seed: int, scale_px: float = 0.0) -> np.ndarray:
    white = np.random.default_rng(seed).standard_normal(SHAPE)
    smooth = cv2.GaussianBlur(white, (0, 0), scale_px) if scale_px else white
    return smooth / smooth.std()


def fit(residual: np.ndarray, sky: np.ndarray | None = None) -> Fit:
    return Fit(residual, residual if sky is None else sky, DISK, 5)


@pytest.mark.parametrize("scale_px", [0.0, 1.0, 2.0])
def test_what_fits_equally_well_is_never_better(scale_px: float) -> None:
    """Of residuals that differ by accident only, of independent pixels and of ones that go together."""
    found = [better_by(fit(noise(seed, scale_px)), fit(noise(500 + seed, scale_px)))[1] for seed in range(200)]
    print(np.mean(found), np.std(found), max(found), SIGMAS)
    assert abs(np.mean(found)) < 0.3
    assert np.std(found) < 1.3
    assert max(found) < SIGMAS


@pytest.mark.parametrize("scale_px", [0.0, 2.0])
def test_what_leaves_less_all_over_the_disk_is_better_and_what_does_in_one_place_only_is_not(scale_px: float) -> None:
    seen = noise(1, scale_px)
    ratio, sigmas = better_by(fit(seen), fit(1.6 * seen))
    assert ratio == pytest.approx(2.56)
    assert sigmas > SIGMAS
    speck = np.hypot(X - 40, Y - 44) < 3
    ratio, sigmas = better_by(fit(seen), fit(seen + 20.0 * speck))
    assert ratio > 2
    assert sigmas < 2


def test_errors_that_go_together_count_once() -> None:
    assert shared(noise(2), 8) < 1.3
    assert shared(noise(2, 3.0), 8) > 15
    assert shared(np.ones(SHAPE), 8) == pytest.approx(64.0)
    assert shared(np.zeros(SHAPE), 8) == 1.0


@pytest.mark.parametrize("scale_px", [0.0, 1.0, 2.0])
def test_a_disk_is_no_chance_and_one_that_was_fitted_to_noise_is(scale_px: float) -> None:
    assert better_than_sky(fit(noise(3), noise(3) + 20.0 * DISK))[1] > 1000
    worst = 0.0
    for seed in range(100):
        sky = noise(seed, scale_px)
        amplitude, level = float(sky[DISK].mean()), 0.0
        worst = max(worst, better_than_sky(fit(np.where(DISK, sky - amplitude, sky - level), sky))[1])
    print(worst, GAIN)
    assert worst < GAIN


def test_only_pixels_that_both_have_are_compared_unless_a_mask_hides_nearly_all_of_them() -> None:
    seen = noise(4)
    cut = seen.copy()
    cut[:, :20] = np.nan
    sky = seen + 20.0 * DISK
    at_the_edge = Fit(cut, np.where(np.isfinite(cut), sky, np.nan), DISK, 8)
    assert better_by(Fit(seen, sky, DISK, 8), at_the_edge) == (pytest.approx(1.0), pytest.approx(0.0))
    hidden = Fit(np.where(DISK, np.nan, seen), np.where(DISK, np.nan, seen), DISK, 8)
    assert better_by(Fit(seen, sky, DISK, 8), hidden)[1] > SIGMAS


def test_too_few_pixels_tell_nothing() -> None:
    few = np.zeros(SHAPE, bool)
    few[:3, :3] = True
    narrow = Fit(noise(5), 10 * noise(5), few, 8)
    assert better_than_sky(narrow) == (1.0, 0.0)
    assert better_by(narrow, Fit(10 * noise(5), noise(5), few, 8)) == (1.0, 0.0)
