"""Files that the writers make are read as the cameras' own."""

from pathlib import Path

import numpy as np
import pytest

from catalog.camera import Camera, find_camera, known_cameras
from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers import read_frame
from lab.demo.images import demo
from lab.simulate.writers import RawImage, raw_suffix, write_raw_image

CAMERAS = sorted({image.camera for image in demo().images})
POSES = {image.camera: image.pose for image in demo().images}
FORMATS = {"newhorizons-lorri": "lorri-fits", "galileo-ssi": "galileo-redr"}


def raw_image(camera: Camera) -> RawImage:
    columns, rows = camera.detector_size_px
    rng = np.random.default_rng(7)
    image = np.rint(rng.uniform(1, 200, (rows, columns))).astype(np.float32)
    missing = np.zeros((rows, columns), bool)
    missing[30:32, 100:] = True
    image[missing] = 0
    saturated = np.zeros((rows, columns), bool)
    image[50, 60], saturated[50, 60] = camera.saturation_dn or 0, True
    noise = np.full((rows, columns), 1.5, np.float32)
    return RawImage("C1234567", camera, "europa", POSES[camera.name], 0.18, image, noise, saturated, missing)


@pytest.mark.parametrize("name", CAMERAS)
def test_pixels_camera_target_time_and_flags_come_back(name: str, tmp_path: Path) -> None:
    raw = raw_image(find_camera(name))
    path = tmp_path / f"C1234567{raw_suffix(raw.camera)}"
    write_raw_image(raw, path)
    frame = read_frame(path)
    assert (frame.format, frame.camera, frame.target) == (FORMATS.get(name, "voyager-vicar"), name, "europa")
    assert frame.exposure_s == pytest.approx(0.18)
    assert frame.et == pytest.approx(raw.pose.et, abs=0.6)  # Voyager's labels have whole seconds
    np.testing.assert_array_equal(frame.observation.image, raw.image)
    quality = frame.observation.quality
    assert ((quality & Quality.MISSING) != 0)[raw.missing].all()
    assert quality[50, 60] == Quality.SATURATED
    assert ((quality != 0) & ~raw.missing & ~raw.saturated).sum() in (0, 34)  # LORRI's housekeeping pixels


def test_lorris_header_holds_the_given_pose_but_for_the_attitude(tmp_path: Path) -> None:
    raw = raw_image(find_camera("newhorizons-lorri"))
    write_raw_image(raw, tmp_path / "x.fit")
    frame = read_frame(tmp_path / "x.fit")
    label = frame.label_pose
    assert label.et == raw.pose.et
    assert label.body_from_j2000 is None
    for key in ("camera_from_j2000", "target_from_spacecraft_km", "sun_from_target_km"):
        np.testing.assert_allclose(getattr(label, key), getattr(raw.pose, key), rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(frame.observation.noise, raw.noise)


def test_a_camera_whose_format_is_not_written_is_refused() -> None:
    with pytest.raises(RefusedError, match="cassini-nac"):
        raw_suffix(known_cameras()["cassini-nac"])
