"""Planted errors are exactly what their definition says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.camera import find_camera
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from lab.demo.images import demo
from lab.simulate.plant import planted, pose_error
from tasks.point.rotation import pose_moved_by

TARGET = find_target("europa")
IMAGES = demo().images


@settings(max_examples=30, deadline=None)
@given(
    index=st.integers(0, len(IMAGES) - 1),
    offset_px=st.tuples(st.floats(-400, 400), st.floats(-400, 400)),
    range_factor=st.floats(0.98, 1.02),
    attitude_deg=st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-2, 2)),
)
def test_correcting_by_the_planted_amounts_gives_the_truth_back(
    index: int, offset_px: tuple[float, float], range_factor: float, attitude_deg: tuple[float, float, float]
) -> None:
    truth, camera = IMAGES[index].pose, find_camera(IMAGES[index].camera)
    wrong = planted(truth, camera, offset_px, range_factor, attitude_deg)
    moved = pose_moved_by(wrong, camera, offset_px).with_range_factor(range_factor)
    right = moved.replaced(body_from_j2000=rotation_from_vector_deg(attitude_deg).T @ moved.body_from_j2000)
    error = pose_error(right, truth, camera, TARGET)
    assert np.hypot(*error.centre_px) < 1e-6
    assert error.range == pytest.approx(0, abs=1e-12)
    assert right.body_from_j2000 == pytest.approx(truth.body_from_j2000, abs=1e-12)


def test_the_true_pose_has_no_error() -> None:
    image = IMAGES[0]
    error = pose_error(image.pose, image.pose, find_camera(image.camera), TARGET)
    assert error.centre_px == (0, 0)
    assert error.range == 0
    assert error.attitude_deg == pytest.approx(0, abs=1e-7)
    assert error.surface_px == 0


def test_each_kind_of_error_is_measured_in_its_own_unit() -> None:
    image = IMAGES[0]
    camera = find_camera(image.camera)
    pointing = pose_error(planted(image.pose, camera, (3, -4), 1, (0, 0, 0)), image.pose, camera, TARGET)
    assert pointing.centre_px == pytest.approx((-3, 4), abs=1e-6)
    assert pointing.surface_px == pytest.approx(5, rel=1e-3)
    distance = pose_error(planted(image.pose, camera, (0, 0), 0.99, (0, 0, 0)), image.pose, camera, TARGET)
    assert distance.range == pytest.approx(1 / 0.99 - 1, rel=1e-9)
    attitude = pose_error(planted(image.pose, camera, (0, 0), 1, (0.6, 0, 0.8)), image.pose, camera, TARGET)
    assert attitude.attitude_deg == pytest.approx(1.0, rel=1e-6)
    radius_px = camera.focal_length_px * TARGET.mean_radius_km / image.pose.range_km
    assert 0.3 < attitude.surface_px / (np.radians(1) * radius_px) < 1


def test_the_planted_errors_have_the_size_that_the_paper_reports() -> None:
    for image in IMAGES:
        mean_px, largest_px = image.paper_offset_px
        assert 0.9 * mean_px < np.hypot(*image.offset_px) < largest_px
        assert 0.985 <= image.range_factor <= 1.001
        assert 0.5 < np.linalg.norm(image.attitude_deg) < 1.7
