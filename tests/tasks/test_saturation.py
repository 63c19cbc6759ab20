"""A saturated disk is recognised by its area; hot pixels, columns and stars are not taken for it."""

import numpy as np
import pytest

from catalog.errors import RefusedError
from catalog.observation import Observation, Quality
from tasks.point.coarse import without_specks
from tasks.point.loop import refuse_saturated
from tasks.undistort.saturation import clipped_plate, with_plate_flagged

SHAPE = (160, 180)


def disk(radius_px: float = 40.0, peak: float = 900.0, noise: float = 4.0, phase_cosine: float = 0.8) -> np.ndarray:
    """A Lambert sphere in whole numbers, on a noisy sky of 20."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    across = np.hypot(x - 92.3, y - 78.6) / radius_px
    height = np.sqrt(np.clip(1 - across**2, 0, None))
    lit = np.clip(phase_cosine * height + np.sqrt(1 - phase_cosine**2) * (x - 92.3) / radius_px, 0, None) * (across < 1)
    return np.round(20 + peak * lit + np.random.default_rng(1).normal(0, noise, SHAPE)).astype(np.float32)


def observed(image: np.ndarray) -> Observation:
    return Observation(image.astype(np.float32), np.ones(SHAPE, np.float32), np.zeros(SHAPE, np.uint16))


def with_hot_pixels(image: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(3)
    image = image.copy()
    image[rng.integers(0, SHAPE[0], 130), rng.integers(0, SHAPE[1], 130)] = 4095
    return image


def with_columns(image: np.ndarray) -> np.ndarray:
    image = image.copy()
    image[:, [30, 31, 95, 150]] = 4095
    return image


def with_stars(image: np.ndarray) -> np.ndarray:
    image = image.copy()
    for y, x in ((10, 10), (30, 140), (140, 20), (150, 160)):
        image[y : y + 4, x : x + 4] = 4095
    return image


def with_tracks(image: np.ndarray) -> np.ndarray:
    """Cosmic rays at a slant."""
    image = image.copy()
    for k in range(60):
        image[20 + k, 60 + k : 62 + k] = 4095
    return image


FAULTS = [with_hot_pixels, with_columns, with_stars, with_tracks]


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("peak", [60.0, 900.0])
def test_bright_specks_are_no_saturated_disk(fault, peak) -> None:
    observation = observed(fault(disk(peak=peak, noise=peak / 200)))
    refuse_saturated(observation)
    assert clipped_plate(observation) is None


@pytest.mark.parametrize("fault", [lambda image: image, *FAULTS])
@pytest.mark.parametrize("radius_px", [12.0, 40.0])
@pytest.mark.parametrize("share_of_peak", [0.1, 0.2])
def test_a_disk_clipped_at_any_value_is_refused_whatever_else_is_bright(fault, radius_px, share_of_peak) -> None:
    image = np.minimum(disk(radius_px), 20 + share_of_peak * 900)
    with pytest.raises(RefusedError, match=f"clipped at the value {20 + share_of_peak * 900:g}") as refusal:
        refuse_saturated(observed(fault(image)))
    assert refusal.value.code == "saturated"


@pytest.mark.parametrize("fault", [lambda image: image, *FAULTS])
def test_the_plate_of_a_partly_clipped_disk_is_flagged_and_the_rest_used(fault) -> None:
    image = disk()
    clipped = image > 700
    observation = with_plate_flagged(observed(fault(np.minimum(image, 700))))
    flagged = (observation.quality & np.uint16(Quality.SATURATED)) != 0
    assert 0.6 * clipped.sum() < (flagged & clipped).sum()
    assert not (flagged & (image < 690)).any()
    refuse_saturated(observation)


def test_a_disk_that_its_reader_flagged_as_saturated_is_refused_too() -> None:
    image = disk()
    quality = np.where(image > 200, np.uint16(Quality.SATURATED), np.uint16(0))
    with pytest.raises(RefusedError, match="the disk is saturated"):
        refuse_saturated(Observation(image, np.ones(SHAPE, np.float32), quality))


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize(("radius_px", "phase_cosine"), [(40.0, 0.8), (12.0, 0.8), (40.0, -0.7)])
def test_specks_are_pulled_down_to_the_brightness_of_the_target(fault, radius_px, phase_cosine) -> None:
    image = disk(radius_px, phase_cosine=phase_cosine)
    width_px = radius_px * (1 + phase_cosine)
    cleaned = without_specks(observed(fault(image)), width_px).image
    specks = fault(image) > 2000
    print(image.max(), cleaned[specks].max())
    assert cleaned[specks].max() < 1.5 * image.max()
    np.testing.assert_array_equal(cleaned[~specks], np.minimum(image, cleaned.max())[~specks])


def test_an_empty_or_unusable_frame_is_left_to_others() -> None:
    empty = observed(np.zeros(SHAPE))
    refuse_saturated(empty)
    unusable = Observation(empty.image, empty.noise, np.full(SHAPE, np.uint16(Quality.MISSING)))
    refuse_saturated(unusable)
    assert without_specks(unusable, 20.0) is unusable
