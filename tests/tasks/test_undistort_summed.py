"""Distortion of summed pixels is the detector's: the same directions, in larger pixels."""

import numpy as np
import pytest

from catalog.camera import find_camera
from tasks.undistort import UndistortSettings
from tasks.undistort.choose import chosen_model


@pytest.mark.parametrize("summing", [2, 4])
@pytest.mark.parametrize("name", ["galileo-ssi", "newhorizons-lorri", "voyager1-nac"])
def test_directions_of_summed_pixels_are_those_of_the_detector(name: str, summing: int) -> None:
    camera = find_camera(name)
    summed = camera.summed(summing)
    whole, _ = chosen_model(camera, UndistortSettings())
    model, _ = chosen_model(summed, UndistortSettings())
    places = np.random.default_rng(0).uniform(100, 600, (40, 2))
    there = (places + 0.5) / summing - 0.5
    assert np.allclose(
        summed.ray(model.undistort_points(there)), camera.ray(whole.undistort_points(places)), atol=1e-12
    )
    assert np.allclose(model.distort_points(model.undistort_points(there)), there, atol=1e-6)
    assert (model.raw_size_px, model.size_px) == (summed.detector_size_px, summed.size_px)
    if name != "voyager1-nac":  # whose distortion is measured on each image
        assert np.allclose(summed.detector_ray(there), camera.detector_ray(places), atol=1e-12)
