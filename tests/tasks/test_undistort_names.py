"""Names of distortion models: those of optics and those that are fitted to marks are two sets."""

from typing import get_args

import numpy as np
import pytest

from catalog.camera import known_cameras
from catalog.observation import Observation
from catalog.optics import OPTICS_NAMES
from tasks.undistort import undistort
from tasks.undistort.choose import chosen_method, chosen_model
from tasks.undistort.methods import METHODS
from tasks.undistort.settings import OpticsMethod, UndistortSettings


def test_no_model_of_optics_has_the_name_of_a_method_for_marks() -> None:
    assert not set(OPTICS_NAMES) & set(METHODS)
    assert set(get_args(OpticsMethod)) == set(OPTICS_NAMES)


@pytest.mark.parametrize("name", sorted(n for n, c in known_cameras().items() if c.distortion.model != "reseau"))
def test_every_camera_of_the_catalog_can_be_undistorted(name: str) -> None:
    camera = known_cameras()[name]
    assert chosen_method(camera, UndistortSettings()) == camera.distortion.model
    model, _ = chosen_model(camera, UndistortSettings())
    middle = [size / 2 for size in camera.detector_size_px]
    assert model.distort_points(model.undistort_points(middle)) == pytest.approx(middle, abs=1e-6)


@pytest.mark.parametrize("name", ["near-msi", "dawn-fc2", "osirisrex-polycam", "hayabusa-amica", "clementine-uvvis"])
def test_a_spot_of_the_raw_frame_is_where_its_ray_is_in_the_undistorted_one(name: str) -> None:
    """Detectors whose lines run upwards, whose pixels are oblong, or that are turned by 90 degrees."""
    camera = known_cameras()[name]
    nx, ny = camera.detector_size_px
    x, y = 0.7 * nx, 0.2 * ny
    columns, lines = np.meshgrid(np.arange(nx), np.arange(ny))
    image = np.exp(-0.5 * ((columns - x) ** 2 + (lines - y) ** 2) / 3.0**2).astype(np.float32)
    frame = Observation(image, np.ones_like(image), np.zeros(image.shape, np.uint16))
    seen = undistort(frame, camera, UndistortSettings()).observation.image
    rows, places = np.indices(seen.shape)
    spot = np.array([(seen * places).sum(), (seen * rows).sum()]) / seen.sum()
    assert spot == pytest.approx(camera.project(camera.detector_ray([x, y])), abs=0.02)
