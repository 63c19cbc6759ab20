"""The simulated detector: geometry, noise, marks, damage and rounding."""

import numpy as np
import pytest

from catalog.basemap import uniform_map
from catalog.camera import Camera, find_camera
from catalog.observation import Observation
from catalog.target import find_target
from lab.demo.images import demo
from lab.simulate.cameras import simulated_camera
from lab.simulate.detector import Exposure, clean_exposure, let_through, raw_frame, recorded
from lab.simulate.optics import nominal_optics
from lab.simulate.picture import picture_of
from lab.simulate.surface import TrueSurface
from tasks.point.rotation import pose_moved_by
from tasks.undistort import UndistortSettings, undistort

DEMO = {image.product: image for image in demo().images}


def clean(camera: Camera) -> Exposure:
    return clean_exposure(camera, simulated_camera(camera.name).detector)


@pytest.mark.parametrize("product", ["SIM_VG2_NAC", "SIM_SSI"])
def test_undistorting_the_raw_frame_gives_the_picture_back(product: str) -> None:
    image = DEMO[product]
    camera, target = find_camera(image.camera), find_target("europa")
    pose = pose_moved_by(image.pose, camera, (60.0, 90.0))  # the whole disk inside the frame
    surface = TrueSurface("lunar-lambert", {}, uniform_map())
    picture = picture_of(pose, camera, target, surface, 1.0, oversample=2)
    raw = raw_frame(picture, nominal_optics(camera))
    observation = Observation(raw, np.ones_like(raw), np.zeros(raw.shape, np.uint16))
    back = undistort(observation, camera, UndistortSettings()).observation.image
    shift = _brightness_centre(picture.window.crop(back)) - _brightness_centre(picture.brightness)
    print(f"{product}: brightness centre moved by {shift.round(4)} px")
    assert np.hypot(*shift) < 0.02


def _brightness_centre(picture: np.ndarray) -> np.ndarray:
    y, x = np.indices(picture.shape)
    return np.array([(picture * axis).sum() / picture.sum() for axis in (x, y)])


def test_noise_follows_the_cameras_model() -> None:
    camera = find_camera("newhorizons-lorri")
    flat = np.full((400, 400), 1000.0, np.float32)
    sent = recorded(flat, camera, clean(camera), np.random.default_rng(2))
    expected = np.sqrt(
        camera.noise.read_dn**2 + 1000 / camera.noise.gain_e_per_dn + (camera.noise.relative * 1000) ** 2
    )
    assert sent.image.std() == pytest.approx(expected, rel=0.01)
    assert sent.noise.mean() == pytest.approx(expected, rel=1e-4)
    assert sent.image.mean() == pytest.approx(1000, abs=0.1)


def test_eight_bit_cameras_record_whole_numbers_and_saturate() -> None:
    bright = np.full((20, 20), 100.0, np.float32)
    bright[5, 5] = 400.0
    camera = find_camera("voyager1-nac")
    sent = recorded(bright, camera, clean(camera), np.random.default_rng(3))
    assert (sent.image == np.rint(sent.image)).all()
    assert sent.image.max() == 255
    assert np.argwhere(sent.saturated).tolist() == [[5, 5]]


def test_reseau_marks_are_dark_at_their_sub_pixel_place_and_those_outside_change_nothing() -> None:
    lost = 1000 * (1 - let_through((20, 30), np.array([[10.3, 5.9], [-9.0, 8.0]])))
    y, x = np.indices(lost.shape)
    assert lost[6, 10] == pytest.approx(900, rel=0.05)
    assert np.abs(lost[12:]).max() < 1
    assert [(lost * axis).sum() / lost.sum() for axis in (x, y)] == pytest.approx([10.3, 5.9], abs=0.02)


def test_cosmic_rays_telemetry_errors_and_missing_lines_are_few_and_recorded() -> None:
    camera = find_camera("galileo-ssi")
    damaged = Exposure(100.0, (3.0, 3.0), camera.noise, cosmic_rays=30, spikes=20, gaps=2)
    flat = np.full((200, 300), 50.0, np.float32)
    sent = recorded(flat, camera, damaged, np.random.default_rng(6))
    odd = np.abs(sent.image - 50) > 8
    facts = sent.facts
    assert (sent.image[sent.missing] == 0).all()
    assert bool(sent.missing.any()) == bool(facts["missing_lines"])
    hit = int((odd & ~sent.missing).sum())
    assert 20 < hit < 4 * facts["cosmic_rays"] + facts["spikes"]
    for line, lines, sample in facts["missing_lines"]:
        assert sent.missing[line : line + lines, sample:].all()


def test_the_same_seed_gives_the_same_frame() -> None:
    flat, camera = np.full((8, 8), 50.0, np.float32), find_camera("galileo-ssi")
    first, second = (recorded(flat, camera, clean(camera), np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(first.image, second.image)
