"""The cached step leaves the undistorted image, its uncertainty, and for sensor space the raw frame."""

from pathlib import Path

import numpy as np
import pytest

from catalog.camera import known_cameras
from catalog.digest import sha256_of_file
from catalog.observation import Observation
from lab.simulate.writers.fits import write_fits
from tasks.image_file import ImageInputs
from tasks.stored import load_arrays, load_observation
from tasks.undistort import UndistortSettings
from tasks.undistort.step import DISTORTION, UndistortFiles, UndistortInputs, run
from tasks.work import Work


@pytest.mark.parametrize("space", ["resampled", "sensor"])
def test_the_step_stores_what_later_steps_and_cubes_need(tmp_path: Path, space: str) -> None:
    camera = known_cameras()["galileo-ssi"]
    image = np.random.default_rng(0).uniform(0, 200, (800, 800)).astype(np.float32)
    path = tmp_path / "frame.fits"
    observation = Observation(image, np.ones_like(image), np.zeros(image.shape, np.uint16))
    write_fits(path, observation, camera.name, "europa", 0.0, 1.0, as_bytes=False)
    image_file, settings = ImageInputs(sha256=sha256_of_file(path)), UndistortSettings(space=space)
    inputs = UndistortInputs(image=image_file, camera=camera, undistorted=False, settings=settings)
    folder = tmp_path / space
    folder.mkdir()
    result = run(inputs, UndistortFiles(path, None, None), Work(folder, lambda *_: None))
    assert result.evidence["space"] == space
    assert load_observation(folder).image.shape == (800, 800)
    assert not np.array_equal(load_observation(folder).image, image)
    beside = load_arrays(folder / DISTORTION)
    assert beside["uncertainty_px"].shape == (800, 800)
    assert ("sensor_image" in beside) == (space == "sensor")
    if space == "sensor":
        assert np.array_equal(beside["sensor_image"], image)
        assert beside["sensor_x_px"][0, 0] == pytest.approx(0.84, abs=0.01)
        assert beside["sensor_y_px"][799, 0] == pytest.approx(798.16, abs=0.01)
