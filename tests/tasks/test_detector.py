"""The simulated detector: geometry, noise, marks and rounding."""

import numpy as np
import pytest

from catalog.basemap import uniform_map
from catalog.camera import find_camera
from catalog.demo import demo
from catalog.observation import Observation, Quality
from catalog.target import find_target
from tasks.point.rotation import pose_moved_by
from tasks.simulate.detector import exposed, raw_frame
from tasks.simulate.scene import Scene
from tasks.undistort import UndistortSettings, undistort

DEMO = {image.product: image for image in demo().images}


@pytest.mark.parametrize("product", ["SIM_VG2_NAC", "SIM_SSI"])
def test_undistorting_the_raw_frame_gives_the_simulation_back(product: str) -> None:
    image = DEMO[product]
    camera, target = find_camera(image.camera), find_target("europa")
    pose = pose_moved_by(image.pose, camera, (60.0, 90.0))  # the whole disk inside the frame
    scene = Scene(camera, target, uniform_map())
    blank = np.zeros(camera.detector_size_px[::-1], np.float32)
    nothing = Observation(blank, blank, blank.astype(np.uint16))
    model = undistort(nothing, camera, UndistortSettings(space="sensor")).model
    raw = raw_frame(scene, pose, model, peak_dn=200.0, sky_dn=0.0)
    observation = Observation(raw, np.ones_like(raw), np.zeros(raw.shape, np.uint16))
    back = undistort(observation, camera, UndistortSettings()).observation.image
    direct = scene.render(pose)
    shift = _brightness_centre(direct.window.crop(back)) - _brightness_centre(direct.image())
    print(f"{product}: brightness centre moved by {shift.round(4)} px")
    assert np.hypot(*shift) < 0.02


def _brightness_centre(picture: np.ndarray) -> np.ndarray:
    y, x = np.indices(picture.shape)
    return np.array([(picture * axis).sum() / picture.sum() for axis in (x, y)])


def test_noise_follows_the_cameras_model() -> None:
    camera = find_camera("newhorizons-lorri")
    flat = np.full((400, 400), 1000.0, np.float32)
    observation = exposed(flat, camera, np.random.default_rng(2))
    expected = np.sqrt(
        camera.noise.read_dn**2 + 1000 / camera.noise.gain_e_per_dn + (camera.noise.relative * 1000) ** 2
    )
    assert observation.image.std() == pytest.approx(expected, rel=0.01)
    assert observation.noise.mean() == pytest.approx(expected, rel=1e-4)
    assert observation.image.mean() == pytest.approx(1000, abs=0.1)


def test_eight_bit_cameras_record_whole_numbers_and_flag_saturation() -> None:
    bright = np.full((20, 20), 100.0, np.float32)
    bright[5, 5] = 400.0
    observation = exposed(bright, find_camera("voyager1-nac"), np.random.default_rng(3))
    assert (observation.image == np.rint(observation.image)).all()
    assert observation.image.max() == 255
    assert observation.quality[5, 5] == Quality.SATURATED
    assert not observation.quality[0, 0]


def test_reseau_marks_are_dark_at_their_sub_pixel_place_and_those_outside_change_nothing() -> None:
    marks = np.array([[10.3, 5.9], [-9.0, 8.0]])
    camera = find_camera("voyager1-nac").model_copy(update={"saturation_dn": None})
    flat = np.full((20, 30), 1000.0, np.float32)
    marked, plain = (exposed(flat, camera, np.random.default_rng(4), m).image for m in (marks, marks[1:]))
    lost = plain - marked
    y, x = np.indices(lost.shape)
    assert lost[6, 10] == pytest.approx(900, rel=0.05)
    assert np.abs(lost[12:]).max() < 1
    assert [(lost * axis).sum() / lost.sum() for axis in (x, y)] == pytest.approx([10.3, 5.9], abs=0.02)


def test_the_same_seed_gives_the_same_frame() -> None:
    flat = np.full((8, 8), 50.0, np.float32)
    first, second = (exposed(flat, find_camera("galileo-ssi"), np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(first.image, second.image)
