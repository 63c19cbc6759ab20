"""Displacement between two products: planted shifts come back, residual distortion is taken out."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from catalog.observation import Observation
from tasks.undistort.compare import DisplacementField, displacement_field, residual_model
from tasks.undistort.resample import resampled

SIZE = 400


def texture(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (100 + 60 * cv2.GaussianBlur(rng.normal(0, 1, (SIZE, SIZE)), (0, 0), 2.5)).astype(np.float32)


def bent(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The image with every patch moved by a smooth shift, and that shift at each pixel (ny, nx, 2)."""
    y, x = np.mgrid[0:SIZE, 0:SIZE].astype(np.float64)
    shift = np.stack([0.8 * np.sin(y / 90), 0.6 * np.cos(x / 110) + 0.3], axis=-1)
    moved = map_coordinates(image, [y - shift[..., 1], x - shift[..., 0]], order=5, mode="reflect")
    return moved.astype(np.float32), shift


def test_planted_shifts_are_measured_to_a_few_hundredths_through_gain_offset_and_noise() -> None:
    image = texture(1)
    moved, shift = bent(image)
    second = 0.3 * moved - 7 + np.random.default_rng(2).normal(0, 0.1, image.shape)
    field = displacement_field(image, second.astype(np.float32), np.ones(image.shape, bool))
    at = field.xy.astype(int)
    error = np.linalg.norm(field.shift_px - shift[at[:, 1], at[:, 0]], axis=1)
    print(f"{len(field.xy)} windows, error median {np.median(error):.3f}, 95 % {np.percentile(error, 95):.3f} px")
    assert len(field.xy) > 200
    assert np.median(error) < 0.04
    assert np.percentile(error, 95) < 0.1


def test_a_residual_distortion_is_corrected() -> None:
    image = texture(3)
    moved, _ = bent(image)
    everywhere = np.ones(image.shape, bool)
    before = displacement_field(image, moved, everywhere)
    model = residual_model(before, (SIZE, SIZE))
    again = resampled(Observation(moved, np.ones_like(moved), np.zeros(moved.shape, np.uint16)), model)
    after = displacement_field(image, again.image, everywhere)
    assert before.summary()["median_px"] > 0.5
    assert after.summary()["median_px"] < 0.05


def test_windows_without_structure_or_with_a_bare_edge_are_left_out() -> None:
    flat = np.full((SIZE, SIZE), 50.0, np.float32)
    assert displacement_field(flat, flat, np.ones(flat.shape, bool)).summary() == {"windows": 0}
    edge = flat.copy()
    edge[:, 200:] = 150.0
    noisy = [edge + np.random.default_rng(seed).normal(0, 2, edge.shape).astype(np.float32) for seed in (1, 2)]
    assert len(displacement_field(noisy[0], noisy[1], np.ones(flat.shape, bool)).xy) == 0


def test_unusable_pixels_are_not_compared() -> None:
    image = texture(4)
    usable = np.ones(image.shape, bool)
    usable[:, :200] = False
    field = displacement_field(image, image, usable)
    assert (field.xy[:, 0] > 215).all()
    assert np.abs(field.shift_px).max() == pytest.approx(0.0, abs=1e-6)


def test_the_summary_tells_a_common_shift_from_the_rest() -> None:
    xy = np.random.default_rng(0).uniform(0, 100, (50, 2))
    shift = np.tile([3.0, 4.0], (50, 1))
    summary = DisplacementField(xy, shift, np.ones(50)).summary()
    assert summary["mean_px"] == [3.0, 4.0]
    assert summary["median_px"] == 5.0
    assert summary["median_about_mean_px"] == pytest.approx(0.0, abs=1e-12)
