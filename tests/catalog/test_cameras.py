"""The catalog's cameras: complete, consistent with their sources, and easy to add to."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catalog.camera import camera_from_dict, find_camera, known_cameras
from catalog.errors import RefusedError

PAPER_CAMERAS = ("voyager1-nac", "voyager1-wac", "voyager2-nac", "voyager2-wac", "galileo-ssi", "newhorizons-lorri")


def test_the_papers_six_cameras_and_those_of_other_missions_are_in_the_catalog() -> None:
    assert set(known_cameras()) >= {*PAPER_CAMERAS, "cassini-nac", "cassini-wac", "dawn-fc2", "messenger-mdis-nac"}
    assert len(known_cameras()) >= 37


@pytest.mark.parametrize("name", sorted(n for n, c in known_cameras().items() if c.distortion.model != "reseau"))
def test_rays_of_a_cameras_detector_lead_back_to_its_pixels(name: str) -> None:
    camera = find_camera(name)
    pixels = np.random.default_rng(1).uniform(0, 1, (60, 2)) * (np.array(camera.detector_size_px) - 1)
    there = camera.project(camera.detector_ray(pixels))
    np.testing.assert_allclose(camera.detector_pixel(camera.detector_ray(pixels)), pixels, atol=1e-6)
    middle = np.abs(pixels / np.array(camera.detector_size_px) - 0.5).max(axis=1) < 0.2
    size = np.array(camera.size_px)
    assert ((there[middle] > 0) & (there[middle] < size)).all()


@pytest.mark.parametrize("name", sorted(set(known_cameras()) - {*PAPER_CAMERAS, "cassini-nac"}))
def test_a_camera_says_how_far_it_was_tried(name: str) -> None:
    assert find_camera(name).tried.endswith(".")
    assert find_camera(name).focal_plane is not None


@pytest.mark.parametrize("name", sorted(known_cameras()))
def test_camera_axes_are_a_right_handed_rotation_of_the_instrument_frame(name: str) -> None:
    matrix = np.array(find_camera(name).camera_from_instrument)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1.0)


@pytest.mark.parametrize("name", sorted(known_cameras()))
def test_camera_names_its_kernels_and_sources(name: str) -> None:
    camera = find_camera(name)
    assert len(camera.kernels) >= 5
    assert camera.sources
    assert camera.naif_spacecraft_id is not None
    assert camera.naif_ck_id is not None


@pytest.mark.parametrize(
    ("name", "pixel_microrad"),
    [("newhorizons-lorri", 4.963571), ("cassini-nac", 5.9907), ("galileo-ssi", 10.16), ("voyager1-nac", 7.859)],
)
def test_pixel_angle_agrees_with_the_instrument_teams_figure(name: str, pixel_microrad: float) -> None:
    assert 1e6 / find_camera(name).focal_length_px == pytest.approx(pixel_microrad, rel=4e-4)


def test_lorri_focal_length_is_that_of_its_kernels_own_scale() -> None:
    camera = find_camera("newhorizons-lorri")
    assert camera.focal_length_px == pytest.approx(2618.4775964615382691 * 76.9408555820574094, rel=1e-12)


@given(
    name=st.sampled_from(sorted(known_cameras())),
    x=st.floats(-500, 1500),
    y=st.floats(-500, 1500),
    scale=st.floats(0.1, 1e6),
)
def test_projecting_a_pixels_ray_returns_the_pixel(name: str, x: float, y: float, scale: float) -> None:
    camera = find_camera(name)
    np.testing.assert_allclose(camera.project(scale * camera.ray([x, y])), [x, y], atol=1e-7)


def test_a_camera_that_is_not_in_the_catalog_is_refused_with_the_known_names() -> None:
    with pytest.raises(RefusedError, match=r"'kodak'.*galileo-ssi.*--camera FILE\.toml"):
        find_camera("kodak")


def test_cameras_tell_how_well_their_focal_length_is_known() -> None:
    for name, camera in known_cameras().items():
        assert "focal_length_sigma" in camera.model_fields_set, name
        assert 1e-5 <= camera.focal_length_sigma <= 1e-3, name
    plain = {"name": "own", "size_px": [9, 9], "centre_px": [4, 4], "focal_length_px": 100}
    assert camera_from_dict(plain, "own").focal_length_sigma == 5e-4
    with pytest.raises(RefusedError, match="focal_length_sigma"):
        camera_from_dict({**plain, "focal_length_sigma": -1e-4}, "own")
