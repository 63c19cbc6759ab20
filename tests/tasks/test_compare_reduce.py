"""The same scene at a fraction of the resolution, and windows within reach of the frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catalog.basemap import uniform_map
from catalog.camera import Camera
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.target import find_target
from tasks.compare.match import framed_window
from tasks.compare.reduce import reduced_camera, reduced_observation, reduced_scene, reduction_for
from tasks.simulate import Scene, SceneSettings
from tasks.simulate.window import disk_radius_px

CAMERA = Camera(name="test", size_px=(203, 150), centre_px=(99.3, 71.8), focal_length_px=40_000, psf_sigma_px=0.9)
SCENE = Scene(CAMERA, find_target("europa"), uniform_map(), SceneSettings(psf_sigma_px=1.2))


def pose_at(centre_px: tuple[float, float], range_km: float = 1e6) -> Pose:
    return Pose(0.0, np.eye(3), CAMERA.ray(centre_px) * range_km, np.array([-1e8, 0, -1e8]), np.eye(3))


@given(st.floats(-50, 250), st.floats(-50, 200), st.integers(1, 8))
def test_a_binned_pixel_is_the_mean_place_of_its_pixels(x: float, y: float, n: int) -> None:
    binned = reduced_camera(CAMERA, n)
    place = binned.project(CAMERA.ray((x, y)))
    assert place * n + (n - 1) / 2 == pytest.approx((x, y), abs=1e-6)
    assert binned.size_px == (203 // n, 150 // n)


def test_the_blur_shrinks_with_the_pixels() -> None:
    assert reduced_camera(CAMERA, 3).psf_sigma_px == pytest.approx(0.3)
    assert reduced_scene(SCENE, 3).psf_sigma_px == pytest.approx(0.4)
    assert reduced_scene(SCENE, 1) is SCENE


@pytest.mark.parametrize(("diameter_px", "n"), [(1000, 1), (125, 1), (60, 2), (31, 4)])
def test_the_bin_size_brings_the_disk_to_the_wanted_diameter(diameter_px: float, n: int) -> None:
    pose = pose_at((100, 70))
    assert 2 * disk_radius_px(pose, CAMERA, SCENE.target) == pytest.approx(125, rel=0.01)
    assert reduction_for(pose, SCENE, diameter_px) == n


def test_cells_are_means_over_usable_pixels_and_their_noise_falls() -> None:
    rng = np.random.default_rng(0)
    image = (50 + rng.standard_normal((40, 44))).astype(np.float32)
    quality = np.zeros(image.shape, np.uint16)
    quality[0:2, 0:2] = Quality.RESEAU
    quality[4, 4:6] = Quality.SATURATED
    quality[9, 9] = Quality.MISSING
    image[quality > 0] = np.nan
    binned = reduced_observation(Observation(image, np.ones_like(image), quality), 2)
    assert binned.image.shape == (20, 22)
    assert not binned.usable[0, 0]
    assert binned.usable.sum() == 20 * 22 - 1
    assert binned.image[2, 2] == pytest.approx(image[5, 4:6].mean())
    assert binned.image[4, 4] == pytest.approx(np.nanmean(image[8:10, 8:10]))
    assert np.isfinite(binned.image).all()
    assert binned.noise[10, 10] == pytest.approx(0.5)
    assert (binned.image[5:] - 50).std() == pytest.approx(0.5, rel=0.1)


def test_rows_and_columns_that_fill_no_cell_are_left_out() -> None:
    image = np.arange(35, dtype=np.float32).reshape(5, 7)
    binned = reduced_observation(Observation(image, np.ones_like(image), np.zeros(image.shape, np.uint16)), 3)
    assert binned.image.tolist() == [[8.0, 11.0]]


def test_a_window_keeps_to_a_rim_of_the_frame_unless_nothing_of_it_is_inside() -> None:
    inside, cut, outside = (framed_window(SCENE, pose_at(centre)) for centre in ((100, 70), (-20, 70), (-400, 70)))
    assert inside == SCENE.window(pose_at((100, 70)))
    assert (cut.x0, cut.y0) == (-8, max(-8, SCENE.window(pose_at((-20, 70))).y0))
    assert outside == SCENE.window(pose_at((-400, 70)))


@pytest.mark.parametrize("radius_px", [500, 70_000])
@pytest.mark.parametrize("side", [(-1, 0), (1, 0), (0, -1), (0.7, 0.7)])
def test_a_window_is_no_larger_than_the_frame_wherever_a_large_disk_is(
    radius_px: int, side: tuple[float, float]
) -> None:
    """A planet of 70 000 px beside the frame was once rendered whole, in 60 GB."""
    nx, ny = SCENE.camera.size_px
    range_km = SCENE.camera.focal_length_px * SCENE.target.mean_radius_km / radius_px
    centre = (nx / 2 + side[0] * (1.2 * radius_px + nx), ny / 2 + side[1] * (1.2 * radius_px + ny))
    ray = SCENE.camera.ray(np.array(centre))
    pose = pose_at((100, 70))
    pose = pose.replaced(target_from_spacecraft_km=pose.camera_from_j2000.T @ ray * range_km)
    window, whole = framed_window(SCENE, pose), SCENE.window(pose)
    assert 1 <= window.shape[0] <= ny + 16
    assert 1 <= window.shape[1] <= nx + 16
    assert whole.x0 <= window.x0 < window.x1 <= whole.x1
    assert whole.y0 <= window.y0 < window.y1 <= whole.y1
