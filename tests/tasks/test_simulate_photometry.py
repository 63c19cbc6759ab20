"""Photometric laws, the detector's blur and boxes, and windows that leave the frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import find_target
from lab.honesty.laws import radiance
from tasks.project.curves import limb_points
from tasks.simulate.photometry import BASES, LAWS, lambert, lommel_seeliger, lunar_lambert, lunar_lambert_weight
from tasks.simulate.scene import detect
from tasks.simulate.window import Window, disk_radius_px, target_window

MU0, MU = np.float32([1, 0.5, 0.2, 0.0]), np.float32([1, 0.5, 0.6, 0.7])
EUROPA = find_target("europa")
CAMERA = Camera(name="test", size_px=(100, 80), centre_px=(49.5, 39.5), focal_length_px=20000)


def pose_at(camera_direction: tuple[float, float, float], range_km: float = 1e6) -> Pose:
    direction = np.array(camera_direction) / np.linalg.norm(camera_direction)
    return Pose(0.0, np.eye(3), direction * range_km, np.array([1e8, 0, -1e8]), np.eye(3))


def test_lambert_is_the_cosine_of_incidence() -> None:
    np.testing.assert_array_equal(lambert(MU0, MU, 40.0), MU0)


def test_lommel_seeliger_is_twice_mu0_over_the_sum_and_one_where_both_are_equal() -> None:
    assert lommel_seeliger(MU0, MU, 40.0) == pytest.approx([1, 1, 0.5, 0])
    assert lommel_seeliger(np.zeros(1, np.float32), np.zeros(1, np.float32), 40.0) == pytest.approx(0)


def test_lunar_lambert_goes_from_lommel_seeliger_at_full_phase_to_lambert_at_large_angles() -> None:
    assert lunar_lambert_weight(0) == 1
    assert lunar_lambert_weight(60) == pytest.approx(1 - 1.14 + 0.8712 - 0.31536)
    assert lunar_lambert_weight(130) == pytest.approx(0, abs=0.5)
    assert lunar_lambert(MU0, MU, 0.0) == pytest.approx(lommel_seeliger(MU0, MU, 0.0))
    weight = lunar_lambert_weight(75)
    expected = weight * lommel_seeliger(MU0, MU, 75.0) + (1 - weight) * MU0
    assert lunar_lambert(MU0, MU, 75.0) == pytest.approx(expected)


@given(st.floats(0, 180), st.floats(0, 180))
def test_the_lunar_lambert_weight_is_a_weight_and_falls_with_the_phase(one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert 0 <= lunar_lambert_weight(high) <= lunar_lambert_weight(low) <= 1


def test_the_mixture_holds_lambert_and_lommel_seeliger_so_that_it_can_be_any_lunar_lambert() -> None:
    bases = np.stack([law(MU0, MU, 50.0) for law in BASES["mixture"]]).astype(np.float64)
    wanted = lunar_lambert(MU0, MU, 50.0)
    weights = np.linalg.lstsq(bases.T, wanted, rcond=None)[0]
    assert weights @ bases == pytest.approx(wanted, abs=1e-6)


def test_every_law_is_dark_at_night() -> None:
    for law in LAWS.values():
        assert law(MU0, MU, 30.0)[-1] == 0


def lit_and_seen(phase_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Cosines of incidence and emission all over a sphere at a phase angle, its limb and terminator left out."""
    normal = np.random.default_rng(3).normal(size=(20_000, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    phase = np.radians(phase_deg)
    mu0, mu = normal @ (np.sin(phase), 0, np.cos(phase)), normal[:, 2]
    inside = (mu0 > 0.03) & (mu > 0.03)
    return mu0[inside].astype(np.float32), mu[inside].astype(np.float32)


@pytest.mark.parametrize("phase_deg", [1.0, 20.0, 60.0, 100.0, 140.0])
def test_akimovs_law_is_what_its_photometric_coordinates_give(phase_deg: float) -> None:
    mu0, mu = lit_and_seen(phase_deg)
    written_out = radiance("akimov", {}, *map(np.float64, (mu0, mu)), np.full(len(mu0), np.radians(phase_deg)))
    ratio = LAWS["akimov"](mu0, mu, phase_deg) / written_out
    assert ratio == pytest.approx(np.median(ratio), rel=0.01)
    assert np.std(ratio) < 1e-3 * np.median(ratio)


@pytest.mark.parametrize("phase_deg", [10.0, 90.0])
@pytest.mark.parametrize("exponent", [0.5, 0.58, 0.65, 0.7, 0.8, 0.9, 1.0])
def test_three_laws_make_any_exponent_of_minnaerts(exponent: float, phase_deg: float) -> None:
    mu0, mu = lit_and_seen(phase_deg)
    wanted = mu0**exponent * mu ** (exponent - 1)
    chosen = [LAWS[name] for name in ("minnaert-half", "minnaert-three-quarters", "lambert")]
    columns = np.stack([law(mu0, mu, phase_deg) for law in chosen], axis=1) / wanted[:, None]
    weights = np.linalg.lstsq(columns, np.ones(len(mu0)), rcond=None)[0]
    assert np.std(columns @ weights) < 4e-3


def sub_pixel_patch(oversample: int) -> np.ndarray:
    fine = np.zeros((40 * oversample, 44 * oversample), np.float32)
    rows, columns = slice(14 * oversample, 23 * oversample + 1), slice(17 * oversample, 26 * oversample - 1)
    fine[rows, columns] = np.random.default_rng(0).random(fine[rows, columns].shape)
    return fine


@pytest.mark.parametrize(("oversample", "psf_sigma_px"), [(1, 0.0), (3, 0.0), (4, 0.8), (2, 1.7), (5, 0.3)])
def test_blur_and_boxes_keep_the_light(oversample: int, psf_sigma_px: float) -> None:
    fine = sub_pixel_patch(oversample)
    seen = detect(fine, oversample, psf_sigma_px)
    assert seen.shape == (40, 44)
    assert seen.sum() * oversample**2 == pytest.approx(fine.sum(), rel=1e-5)


@pytest.mark.parametrize("oversample", [1, 2, 5])
def test_blur_and_boxes_keep_the_centre_of_the_light(oversample: int) -> None:
    fine = sub_pixel_patch(oversample)
    seen = detect(fine, oversample, 0.9)
    for axis in (0, 1):
        place = (np.arange(fine.shape[axis]) + 0.5) / oversample - 0.5
        wanted = (fine.sum(axis=1 - axis) @ place) / fine.sum()
        assert (seen.sum(axis=1 - axis) @ np.arange(seen.shape[axis])) / seen.sum() == pytest.approx(wanted, abs=1e-4)


def test_the_blur_has_the_width_that_was_requested() -> None:
    fine = np.zeros((41 * 5, 41 * 5), np.float32)
    fine[102, 102] = 25.0
    seen = detect(fine, 5, 1.5)
    x = np.arange(41) - 20
    box_variance = (1 - 1 / 25) / 12  # a pixel is five sub-pixels wide
    assert (seen.sum(axis=0) @ x**2) / seen.sum() == pytest.approx(1.5**2 + box_variance, rel=0.01)


def test_a_crop_beyond_the_array_is_filled() -> None:
    array = np.arange(12.0).reshape(3, 4)
    crop = Window(-1, 1, 3, 5).crop(array, fill=-9)
    np.testing.assert_array_equal(crop, [[-9, 4, 5, 6], [-9, 8, 9, 10], [-9] * 4, [-9] * 4])
    np.testing.assert_array_equal(Window(10, 10, 12, 13).crop(array), np.zeros((3, 2)))


@given(*[st.integers(-50, 150)] * 4)
def test_a_clipped_window_lies_in_the_frame(x0: int, y0: int, width: int, height: int) -> None:
    window = Window(x0, y0, x0 + abs(width), y0 + abs(height)).clipped((100, 80))
    assert 0 <= window.x0 <= window.x1 <= 100
    assert 0 <= window.y0 <= window.y1 <= 80


@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(3e4, 4e6))
def test_the_targets_window_holds_its_limb_and_some_sky_wherever_it_is(x: float, y: float, range_km: float) -> None:
    camera, pose = CAMERA.model_copy(update={"focal_length_px": 17000.0}), pose_at((x, y, 1.0), range_km)
    window, limb = target_window(pose, camera, EUROPA), limb_points(pose, camera, EUROPA)
    assert (limb >= np.array([window.x0, window.y0]) + 5).all()
    assert (limb <= np.array([window.x1, window.y1]) - 6).all()


def test_a_target_behind_the_camera_has_no_window() -> None:
    with pytest.raises(ValueError, match="behind the camera"):
        target_window(pose_at((0.1, 0.0, -1.0)), CAMERA, EUROPA)


def test_the_disks_radius_is_that_of_the_tangent_cone() -> None:
    close = pose_at((0, 0, 1), 2 * max(EUROPA.radii_km))
    assert disk_radius_px(close, CAMERA, EUROPA) == pytest.approx(20000 * np.tan(np.radians(30)))


@pytest.mark.parametrize("name", list(LAWS))
def test_a_cosine_that_rounding_leaves_below_zero_is_night(name: str) -> None:
    light = LAWS[name](np.float32([-1e-18, 0.0]), np.float32([0.5, 0.5]), 40.0)
    np.testing.assert_allclose(light, [0, 0], atol=1e-12)
