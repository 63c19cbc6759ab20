"""ISDs that we write: equal to ALE's for the same images, and the camera's own directions by CSM's formulas."""

import json
from pathlib import Path

import numpy as np
import pytest
import spiceypy
from isd_truth import CASES, csm_directions, isd_of, kernel_camera

from catalog.camera import Camera, known_cameras
from catalog.isd import pose_from_isd
from catalog.isd_writing import detector_isd, undistorted_isd
from catalog.target import find_target

EUROPA = find_target("europa")


@pytest.mark.parametrize("name", CASES)
def test_the_isd_that_we_write_is_ales(name: str, data_folder: Path) -> None:
    path, theirs = isd_of(data_folder, name)
    case, camera, pose = CASES[name], kernel_camera(data_folder, name, theirs), pose_from_isd(path).completed()
    ours, residual_px = detector_isd(camera, pose, EUROPA)
    assert ours["center_ephemeris_time"] == pytest.approx(theirs["center_ephemeris_time"], abs=1e-6)
    factor = 1000 if case.metres else 1
    assert ours["focal_length_model"]["focal_length"] == pytest.approx(
        theirs["focal_length_model"]["focal_length"] * factor, rel=1e-9
    )
    # cubic polynomials stand for LORRI's, UVVIS' and CaSSIS' models, which CSM has not; the ISD states how well
    assert residual_px < (0.5 if camera.distortion.model == "rational" else 0.02)
    lorri = name.startswith("lor")  # looks along -Z, which ALE's ISD does not say: ours is turned over to +Z
    turned = np.diag([1.0, -1.0, -1.0]) if lorri else np.eye(3)
    if not lorri:
        for key in ("focal2pixel_samples", "focal2pixel_lines"):
            assert ours[key] == pytest.approx(theirs[key], rel=5e-7, abs=1e-9)
    table, mine = theirs["instrument_pointing"], ours["instrument_pointing"]
    if len(table["quaternions"]) == 1:
        sensor = np.array(table["constant_rotation"]).reshape(3, 3) @ spiceypy.q2m(table["quaternions"][0])
        assert spiceypy.q2m(mine["quaternions"][0]) == pytest.approx(turned @ sensor, abs=1e-9)
        positions = theirs["instrument_position"]["positions"]
        assert ours["instrument_position"]["positions"][0] == pytest.approx(positions[0], abs=1e-5)
    if case.centre_stated:
        shift = 0.5 if case.half_px else 0.0
        for one in ("sample", "line"):
            apart = abs(ours["detector_center"][one] - theirs["detector_center"][one])
            assert apart == pytest.approx(shift, abs=1e-9)


@pytest.mark.parametrize("name", sorted(n for n, c in known_cameras().items() if c.distortion.model != "reseau"))
def test_a_detectors_isd_has_the_directions_of_its_camera(name: str, tmp_path: Path, data_folder: Path) -> None:
    camera = known_cameras()[name]
    pose = pose_from_isd(data_folder / "isd/E6I0032/galileossi_isd.json").completed()
    content, residual_px = detector_isd(camera, pose, EUROPA)
    pixels = np.random.default_rng(8).uniform(0, 1, (60, 2)) * (np.array(camera.detector_size_px) - 1)
    file = tmp_path / "isd.json"
    file.write_text(json.dumps(content))
    read, again = Camera.from_isd(file), pose_from_isd(file).completed()
    wanted = camera.detector_ray(pixels) @ pose.camera_from_j2000
    seen = read.detector_ray(pixels) @ again.camera_from_j2000
    error_px = np.linalg.norm(seen - wanted, axis=1).max() * camera.focal_length_px
    assert error_px < 1.3 * residual_px + 1e-4
    csm = {"radial", "transverse"} & set(content["optical_distortion"])
    if csm:
        centre = np.array([content["detector_center"]["sample"], content["detector_center"]["line"]])
        focal_length = content["focal_length_model"]["focal_length"]
        rays = csm_directions(content, pixels + 0.5 - centre, focal_length, True)
        sensor = spiceypy.q2m(content["instrument_pointing"]["quaternions"][0])
        assert np.linalg.norm(rays @ sensor - seen, axis=1).max() * camera.focal_length_px < 1e-3


def test_the_undistorted_frame_is_an_exact_pinhole(data_folder: Path) -> None:
    camera = known_cameras()["voyager1-nac"]
    pose = pose_from_isd(data_folder / "isd/c1637937/c1637937_isd.json").completed()
    content = undistorted_isd(camera, pose, EUROPA)
    pixels = np.random.default_rng(9).uniform(0, 999, (50, 2))
    centre = np.array([content["detector_center"]["sample"], content["detector_center"]["line"]])
    rays = csm_directions(content, pixels + 0.5 - centre, content["focal_length_model"]["focal_length"], True)
    assert rays == pytest.approx(camera.ray(pixels), abs=1e-12)


@pytest.mark.parametrize("name", ["cassini-nac", "near-msi", "dawn-fc2"])
def test_the_isd_of_a_summed_camera_says_its_summing(name: str, tmp_path: Path, data_folder: Path) -> None:
    camera = known_cameras()[name].summed(2)
    pose = pose_from_isd(data_folder / "isd/E6I0032/galileossi_isd.json").completed()
    content, _ = detector_isd(camera, pose, EUROPA)
    assert content["detector_sample_summing"] == content["detector_line_summing"] == 2
    file = tmp_path / "isd.json"
    file.write_text(json.dumps(content))
    pixels = np.random.default_rng(8).uniform(0, 1, (60, 2)) * (np.array(camera.detector_size_px) - 1)
    read, again = Camera.from_isd(file).summed(2), pose_from_isd(file).completed()
    seen = read.detector_ray(pixels) @ again.camera_from_j2000
    apart = np.linalg.norm(seen - camera.detector_ray(pixels) @ pose.camera_from_j2000, axis=1)
    assert apart.max() * camera.focal_length_px < 0.01
