"""The demo's archive can be read like any other, and its truth lies beside it."""

from pathlib import Path

import numpy as np
import pytest

from catalog.camera import find_camera
from catalog.pose import read_pose_file
from catalog.readers import read_frame
from catalog.target import find_target
from lab.demo.archive import SimulatedImage, simulate_archive
from lab.demo.images import demo
from lab.simulate.plant import pose_error


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> SimulatedImage:
    return simulate_archive(tmp_path_factory.mktemp("archive"), ("SIM_VG2_WAC",))[0]


def test_the_demo_has_one_image_for_each_camera_of_the_paper() -> None:
    cameras = {image.camera for image in demo().images}
    wanted = {"voyager1-nac", "voyager1-wac", "voyager2-nac", "voyager2-wac", "galileo-ssi", "newhorizons-lorri"}
    assert cameras == wanted
    assert len(demo().images) == 6


def test_a_simulated_image_is_read_in_its_raw_geometry_with_camera_target_and_time(simulated: SimulatedImage) -> None:
    frame = read_frame(simulated.image)
    assert (frame.product, frame.camera, frame.target) == ("SIM_VG2_WAC", "voyager2-wac", "europa")
    assert frame.observation.image.shape == (800, 800)
    assert not frame.undistorted
    assert frame.format == "voyager-vicar"
    assert frame.et == pytest.approx(simulated.entry.pose.et, abs=0.6)  # the label's time has whole seconds
    assert 100 < frame.observation.image.max() < 255


def test_predicted_pose_is_wrong_by_what_was_planted(simulated: SimulatedImage) -> None:
    camera, target = find_camera(simulated.entry.camera), find_target("europa")
    predicted, truth = (read_pose_file(path).completed() for path in (simulated.predicted, simulated.truth))
    error = pose_error(predicted, truth, camera, target)
    np.testing.assert_allclose(error.centre_px, -np.array(simulated.entry.offset_px), atol=1e-6)
    assert 1 / (1 + error.range) == pytest.approx(simulated.entry.range_factor, rel=1e-9)


def test_the_archive_is_the_same_every_time(simulated: SimulatedImage, tmp_path: Path) -> None:
    again = simulate_archive(tmp_path, ("SIM_VG2_WAC",))[0]
    assert again.image.read_bytes() == simulated.image.read_bytes()
    assert again.predicted.read_text() == simulated.predicted.read_text()
