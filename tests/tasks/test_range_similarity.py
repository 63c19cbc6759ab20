"""The structural similarity that the range scan maximises."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasks.compare.similarity import SsimSettings, ssim

RNG = np.random.default_rng(0)
TEXTURE = np.cumsum(np.cumsum(RNG.standard_normal((60, 70)), axis=0), axis=1).astype(np.float32)
EVERYWHERE = np.ones(TEXTURE.shape, bool)


def test_equal_images_have_similarity_one() -> None:
    assert ssim(TEXTURE, TEXTURE, EVERYWHERE) == pytest.approx(1.0)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.05, 2.0), st.integers(0, 1000))
def test_noise_lowers_it_and_it_stays_within_bounds(noise: float, seed: int) -> None:
    other = TEXTURE + noise * TEXTURE.std() * np.random.default_rng(seed).standard_normal(TEXTURE.shape)
    noisier = TEXTURE + 3 * (other - TEXTURE)
    assert -1 <= ssim(TEXTURE, noisier, EVERYWHERE) < ssim(TEXTURE, other, EVERYWHERE) < 1


def test_it_is_the_mean_product_of_luminance_contrast_and_structure() -> None:
    from scipy.ndimage import gaussian_filter

    def mean(a: np.ndarray) -> np.ndarray:
        return gaussian_filter(a.astype(np.float64), 1.5, truncate=3.5)

    other = (1.1 * TEXTURE + 0.3 * TEXTURE.std() * RNG.standard_normal(TEXTURE.shape)).astype(np.float32)
    span = np.subtract(*np.percentile(TEXTURE, [99.9, 0.1]))
    c1, c2 = (0.01 * span) ** 2, (0.03 * span) ** 2
    mx, my = mean(TEXTURE), mean(other)
    sx, sy = (np.sqrt(np.maximum(mean(a.astype(np.float64) ** 2) - m**2, 0)) for a, m in ((TEXTURE, mx), (other, my)))
    sxy = mean(TEXTURE.astype(np.float64) * other) - mx * my
    luminance = (2 * mx * my + c1) / (mx**2 + my**2 + c1)
    contrast = (2 * sx * sy + c2) / (sx**2 + sy**2 + c2)
    structure = (sxy + c2 / 2) / (sx * sy + c2 / 2)
    expected = (luminance * contrast * structure).mean()
    assert ssim(TEXTURE, other, EVERYWHERE) == pytest.approx(expected, rel=1e-3)


def test_what_unusable_pixels_hold_does_not_matter() -> None:
    usable = EVERYWHERE.copy()
    usable[10:20, 30:50] = False
    model = TEXTURE + 0.1 * TEXTURE.std() * RNG.standard_normal(TEXTURE.shape).astype(np.float32)
    values = [
        ssim(np.where(usable, TEXTURE, np.float32(rubbish)), model, usable) for rubbish in (0, 1e6, np.nan, np.inf)
    ]
    assert values == [values[0]] * 4
    assert values[0] == pytest.approx(ssim(TEXTURE, model, EVERYWHERE), abs=0.05)


def test_unusable_pixels_neither_help_nor_harm_a_perfect_match() -> None:
    usable = RNG.random(TEXTURE.shape) > 0.2
    assert ssim(np.where(usable, TEXTURE, np.float32(-1e4)), TEXTURE, usable) == pytest.approx(1.0)


def test_without_usable_pixels_there_is_no_similarity_and_a_constant_image_has_none() -> None:
    assert np.isnan(ssim(TEXTURE, TEXTURE, ~EVERYWHERE))
    assert ssim(np.full_like(TEXTURE, 3.0), TEXTURE, EVERYWHERE) == 0.0


def test_a_wrong_scale_lowers_it_more_the_wronger_it_is() -> None:
    from scipy.ndimage import zoom

    disk = np.zeros((90, 90), np.float32)
    y, x = np.indices(disk.shape) - 44.5
    disk[np.hypot(x, y) < 30] = 1

    def scaled(factor: float) -> np.ndarray:
        big = zoom(disk, factor, order=1)
        cut = (big.shape[0] - 70) // 2
        return big[cut : cut + 70, cut : cut + 70]

    values = [ssim(scaled(1.0), scaled(factor), np.ones((70, 70), bool)) for factor in (1.0, 1.03, 1.08, 1.15)]
    assert values == sorted(values, reverse=True)
    assert values[0] - values[1] > 0.01


def test_exponents_choose_the_terms_and_the_whole_image_can_be_one_window() -> None:
    other = 2 * TEXTURE + 5 * TEXTURE.std()
    structure = SsimSettings(luminance=0, contrast=0)
    assert ssim(TEXTURE, other, EVERYWHERE, structure) == pytest.approx(1, abs=0.02)
    assert ssim(TEXTURE, other, EVERYWHERE) < 0.9
    whole = SsimSettings(window="whole", k1=0, k2=0)
    x, y = TEXTURE.astype(np.float64), other.astype(np.float64)
    expected = 2 * x.mean() * y.mean() / (x.mean() ** 2 + y.mean() ** 2) * 2 * x.std() * y.std() / (x.var() + y.var())
    expected *= np.corrcoef(x.ravel(), y.ravel())[0, 1]
    assert ssim(TEXTURE, other, EVERYWHERE, whole) == pytest.approx(expected, rel=1e-6)
    assert ssim(TEXTURE, -TEXTURE, EVERYWHERE, structure) < -0.5
