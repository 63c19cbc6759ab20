"""Undistorting an observation: values, noise and quality arrive where the model says."""

import numpy as np
import pytest

from catalog.camera import Camera, known_cameras
from catalog.errors import RefusedError
from catalog.observation import Observation, Quality
from tasks.undistort import UndistortSettings, undistort
from tasks.undistort.model import Points
from tasks.undistort.resample import resampled


class Shift:
    """Undistorted (x, y) is found at raw (x + dx, y + dy)."""

    name = "shift"

    def __init__(self, dx: float, dy: float) -> None:
        self.shift = np.array([dx, dy])
        self.raw_size_px = self.size_px = (64, 48)

    def distort_points(self, xy: Points) -> Points:
        return np.asarray(xy) + self.shift

    def undistort_points(self, xy_raw: Points) -> Points:
        return np.asarray(xy_raw) - self.shift

    def extrapolated(self, xy: Points) -> np.ndarray:
        return np.asarray(xy)[..., 0] > 60

    def uncertainty_px(self, xy: Points) -> np.ndarray:
        return np.zeros(np.shape(xy)[:-1])


def observation(image: np.ndarray) -> Observation:
    return Observation(
        image.astype(np.float32), np.full(image.shape, 2.0, np.float32), np.zeros(image.shape, np.uint16)
    )


def voyager() -> Camera:
    return known_cameras()["voyager1-nac"]


@pytest.mark.parametrize("kernel", ["bilinear", "bicubic", "lanczos"])
def test_a_linear_ramp_is_resampled_exactly(kernel: str) -> None:
    y, x = np.mgrid[0:48, 0:64]
    out = resampled(observation(10 + 2 * x + 3 * y), Shift(1.25, -2.5), kernel)
    expected = 10 + 2 * (x + 1.25) + 3 * (y - 2.5)
    inner = (slice(8, 40), slice(8, 52))
    assert np.abs(out.image - expected)[inner].max() < 2e-3 * 64


@pytest.mark.parametrize("kernel", ["bilinear", "bicubic", "lanczos"])
def test_the_carried_noise_is_the_scatter_of_resampled_noise(kernel: str) -> None:
    rng = np.random.default_rng(5)
    image = rng.normal(100.0, 2.0, (800, 800)).astype(np.float32)
    raw = Observation(image, np.full((800, 800), 2.0, np.float32), np.zeros((800, 800), np.uint16))
    out = undistort(raw, voyager(), UndistortSettings(kernel=kernel)).observation
    inner = out.usable & ((out.quality & Quality.EXTRAPOLATED_DISTORTION) == 0)
    pull = (out.image[inner] - 100.0) / out.noise[inner]
    assert pull.std() == pytest.approx(1.0, abs=0.01)


def test_a_missing_pixel_spoils_every_output_pixel_it_contributes_to() -> None:
    raw = observation(np.full((48, 64), 7.0))
    raw.quality[20, 30] = Quality.MISSING
    raw.quality[20, 40] = Quality.SUSPECT
    spoiled = np.argwhere(resampled(raw, Shift(0.5, 0.5)).quality & Quality.MISSING)
    assert {(int(y), int(x)) for y, x in spoiled} == {(19, 29), (19, 30), (20, 29), (20, 30)}
    assert np.count_nonzero(resampled(raw, Shift(0.25, 0.25)).quality & Quality.SUSPECT) == 1


def test_outside_the_raw_frame_is_zero_and_flagged() -> None:
    out = resampled(observation(np.full((48, 64), 7.0)), Shift(10.0, 0.0))
    assert (out.image[:, 54:] == 0).all()
    assert ((out.quality[:, 54:] & Quality.OUTSIDE_WINDOW) != 0).all()
    assert (out.image[:, :54] == 7).all()
    assert ((out.quality[:, 61:] & Quality.EXTRAPOLATED_DISTORTION) != 0).all()
    assert (out.quality[:, :54] == 0).all()


def test_voyager_becomes_object_space_and_sensor_space_leaves_pixels_alone() -> None:
    raw = observation(np.random.default_rng(1).uniform(0, 255, (800, 800)))
    flat = undistort(raw, voyager(), UndistortSettings())
    kept = undistort(raw, voyager(), UndistortSettings(space="sensor"))
    assert flat.observation.image.shape == (1000, 1000)
    assert kept.observation is raw
    assert kept.evidence["space"] == "sensor"
    assert flat.evidence["method"] == "thin-plate"
    assert flat.evidence["marks"] == "nominal"  # noise shows no marks
    assert kept.model.size_px == (1000, 1000)


def test_an_already_undistorted_frame_is_returned_unchanged() -> None:
    frame = observation(np.zeros((1000, 1000)))
    result = undistort(frame, voyager(), UndistortSettings(), already_undistorted=True)
    assert result.observation is frame
    assert result.model.name == "none"


@pytest.mark.parametrize("already", [True, False])
def test_a_frame_of_another_size_is_refused(already: bool) -> None:
    with pytest.raises(RefusedError, match="640x480"):
        undistort(observation(np.zeros((480, 640))), voyager(), UndistortSettings(), already_undistorted=already)
