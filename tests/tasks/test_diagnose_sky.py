"""Stray light is found from the sky alone; an even sky, and one that is not seen, are left as they are."""

import numpy as np
import pytest

from catalog.observation import Observation, Quality
from tasks.diagnose.sky import without_stray_light
from tasks.validate.blocks import blocks_of

Y, X = np.mgrid[:160, :200]
DISK = 1000.0 * (np.hypot(X - 120, Y - 70) < 40)
NOISE = np.random.default_rng(3).normal(20, 3, X.shape)


def observed(image: np.ndarray, missing: np.ndarray | None = None) -> Observation:
    quality = np.zeros(image.shape, np.uint16)
    if missing is not None:
        quality[missing] = int(Quality.MISSING)
    return Observation(image.astype(np.float32), np.full(image.shape, 3, np.float32), quality)


@pytest.mark.parametrize(
    "light",
    [4.0 * X, 3000 - 9.0 * Y, 0.03 * (X - 50.0) ** 2, 2.0 * X - 3.0 * Y + 900, 0.05 * (X - 100.0) * (Y - 20.0) + 800],
)
def test_what_slopes_over_the_frame_is_taken_away_and_the_disk_is_not(light: np.ndarray) -> None:
    even = without_stray_light(observed(DISK + NOISE + light))
    assert even is not None
    assert even.span == pytest.approx(np.ptp(light), rel=0.03)
    left = even.observation.image
    assert np.abs(left - DISK - (NOISE - 20)).max() < 0.02 * 1000 + 1


def test_an_even_sky_and_one_that_is_not_seen_are_left() -> None:
    assert without_stray_light(observed(DISK + NOISE)) is None
    assert without_stray_light(observed(DISK + NOISE + 0.1 * X)) is None
    nothing = np.ones(X.shape, bool)
    nothing[:30, :30] = False
    assert without_stray_light(observed(DISK + NOISE + 4.0 * X, nothing)) is None


def blocky(image: np.ndarray, quality: int) -> np.ndarray:
    import cv2

    small = np.clip(255 * image / image.max(), 0, 255).astype(np.uint8)
    _, coded = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE).astype(float)


@pytest.mark.parametrize("shift", [(0, 0), (3, 5)])
def test_blocks_of_a_compression_are_seen_wherever_their_grid_lies(shift: tuple[int, int]) -> None:
    shaded = DISK * (0.3 + 0.002 * X + 0.05 * np.sin(X / 9.0) * np.cos(Y / 7.0)) + NOISE
    strong = np.roll(blocky(shaded, 3), shift, axis=(0, 1))
    found, clean = blocks_of(observed(strong)), blocks_of(observed(shaded))
    print(found, clean, blocks_of(observed(blocky(shaded, 90))))
    assert found is not None
    assert clean is not None
    assert found > 1.6 > 1.3 > clean
    assert blocks_of(observed(np.zeros(X.shape))) is None
