"""Cameras and orientations from kernels against ALE's own image support data (ISD) of the same images.

The ISD's numbers are evaluated here by CSM's published formulas, with no code of the program. Where ALE's driver left
something out, the test says so: half a pixel (drivers that write ISIS' count from 1 as if it were from 0.5), the centre
(0, 0) and distortions. The figures of each image are printed (pytest -s).
"""

from pathlib import Path

import numpy as np
import pytest
import spiceypy
from isd_truth import CASES, csm_directions, isd_of, kernel_camera

from catalog.camera import Camera, camera_from_dict, read_camera_file
from catalog.isd import pose_from_isd
from catalog.spice import kernel_pool
from catalog.spice_pose import orientation_from_loaded


@pytest.mark.parametrize("name", CASES)
def test_the_camera_from_kernels_is_the_one_of_the_isd(name: str, data_folder: Path) -> None:
    case, (_, isd) = CASES[name], isd_of(data_folder, name)
    camera = kernel_camera(data_folder, name, isd)
    plane = camera.focal_plane
    assert plane is not None
    focal_length = isd["focal_length_model"]["focal_length"] * (1000 if case.metres else 1)
    assert camera.focal_length_mm == pytest.approx(focal_length, rel=1e-12)
    px_from_mm = np.array([isd["focal2pixel_samples"][1:], isd["focal2pixel_lines"][1:]])
    assert np.linalg.inv(np.array(plane.mm_from_px)) == pytest.approx(px_from_mm, rel=5e-7)  # printed digits
    centre = np.array([isd["detector_center"]["sample"], isd["detector_center"]["line"]]) - 0.5
    if case.centre_stated:
        apart = np.abs(centre - plane.origin_px)
        assert apart == pytest.approx([0.5, 0.5] if case.half_px else [0.0, 0.0], abs=1e-9)
    # over the whole frame, in pixels counted from the centre; ALE's handedness is +Z but for LORRI, whose ISD misses it
    rng = np.random.default_rng(4)
    pixels = rng.uniform(-0.5, np.array(camera.detector_size_px) - 0.5, (300, 2))
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * (np.array(camera.detector_size_px) - 1)
    pixels = np.vstack([pixels, corners])
    theirs = csm_directions(isd, pixels - plane.origin_px, focal_length, case.distortion_stated)
    sensor_from_camera = np.array(camera.camera_from_instrument, float).T
    ours_by = camera if case.distortion_stated else camera.model_copy(update={"distortion": type(camera.distortion)()})
    ours = ours_by.detector_ray(pixels) @ sensor_from_camera.T
    if name.startswith("lor"):
        ours = ours * [1, 1, -1]
    error_px = np.linalg.norm(ours - theirs, axis=1).max() * camera.focal_length_px
    bent_px = np.linalg.norm(ours_by.detector_ray(pixels) - camera.detector_ray(pixels), axis=1).max()
    back_px = np.abs(camera.detector_pixel(camera.detector_ray(pixels)) - pixels).max()
    left_out = bent_px * camera.focal_length_px
    print(
        f"\n{name}: {camera.name}, f {camera.focal_length_mm:.4f} mm, pitch {camera.pixel_pitch_mm:.7f} mm, centre "
        f"{plane.origin_px} (ISD {tuple(centre.tolist())}), {camera.distortion.model}; directions {error_px:.1e} px, "
        f"there and back {back_px:.1e} px, distortion that the ISD leaves out {left_out:.2f} px"
    )
    assert error_px < 1e-3
    assert back_px < 1e-6


@pytest.mark.parametrize("name", CASES)
def test_the_orientation_at_mid_exposure_is_the_isds(name: str, data_folder: Path) -> None:
    _, isd = isd_of(data_folder, name)
    camera, table = kernel_camera(data_folder, name, isd), isd["instrument_pointing"]
    middle = len(table["quaternions"]) // 2
    et, missing = table["ephemeris_times"][middle], []
    with kernel_pool([data_folder / "isd" / name / "kernels"]):
        ours = orientation_from_loaded(camera, et, missing)
    assert ours is not None, missing
    sensor = np.array(table["constant_rotation"]).reshape(3, 3) @ spiceypy.q2m(table["quaternions"][middle])
    theirs = np.array(camera.camera_from_instrument, float) @ sensor
    apart_deg = float(np.degrees(np.linalg.norm(ours @ theirs.T - np.eye(3)) / np.sqrt(2)))
    print(f"\n{name}: orientation {apart_deg:.1e} deg")
    assert apart_deg < 1e-6


@pytest.mark.parametrize("name", CASES)
def test_a_camera_from_kernels_is_written_as_toml_and_read_to_the_same(
    name: str, data_folder: Path, tmp_path: Path
) -> None:
    _, isd = isd_of(data_folder, name)
    camera = kernel_camera(data_folder, name, isd)
    file = tmp_path / "camera.toml"
    file.write_text(camera.to_toml())
    again = read_camera_file(file)
    assert again == camera
    assert again.sources
    assert any("INS" in source for source in again.sources)
    pixel = np.array(camera.detector_size_px) * 0.8
    assert again.detector_ray(pixel) == pytest.approx(camera.detector_ray(pixel), abs=1e-15)


@pytest.mark.parametrize("name", CASES)
def test_the_isd_makes_a_camera_and_a_pose(name: str, data_folder: Path) -> None:
    """The ISD's camera sees as CSM has it, half a pixel included, and its pose is that of the kernels."""
    path, isd = isd_of(data_folder, name)
    camera, pose = Camera.from_isd(path), pose_from_isd(path).completed()
    if CASES[name].centre_stated:
        focal_length = isd["focal_length_model"]["focal_length"] * (1000 if CASES[name].metres else 1)
        centre = np.array([isd["detector_center"]["sample"], isd["detector_center"]["line"]])
        pixels = np.random.default_rng(5).uniform(0, np.array(camera.detector_size_px) - 1, (50, 2))
        theirs = csm_directions(isd, pixels + 0.5 - centre, focal_length, True)
        ours = camera.detector_ray(pixels) @ np.array(camera.camera_from_instrument, float)
        assert np.linalg.norm(ours - theirs, axis=1).max() * camera.focal_length_px < 1e-3
    with kernel_pool([data_folder / "isd" / name / "kernels"]):
        theirs = orientation_from_loaded(kernel_camera(data_folder, name, isd), pose.et, [])
    assert theirs is not None
    # LORRI's ISD has 1e-9 of its quaternions' digits
    apart = np.degrees(np.linalg.norm(pose.camera_from_j2000 @ theirs.T - np.eye(3)) / np.sqrt(2))
    assert apart < 1e-6 or name.startswith("mpf")
    stated = np.array(isd["instrument_position"]["positions"][0])
    assert pose.range_km == pytest.approx(np.linalg.norm(stated), rel=1e-4)


def test_line_scanners_are_refused_with_the_reason(data_folder: Path) -> None:
    from catalog.errors import RefusedError

    kernels = data_folder / "isd" / "mpf_0295610274_0x539_sci" / "kernels"
    with pytest.raises(RefusedError, match="line scanner"):
        Camera.from_kernels([kernels], -98905, size_px=(5024, 32))


def test_an_unknown_instrument_lists_what_the_kernels_describe(data_folder: Path) -> None:
    from catalog.errors import RefusedError

    kernels = data_folder / "isd" / "N1702360370_1" / "kernels"
    with pytest.raises(RefusedError, match="CASSINI_ISS_WAC"):
        Camera.from_kernels([kernels], "KODAK")


def test_the_focal_length_follows_filter_and_temperature(data_folder: Path) -> None:
    cassini = Camera.from_kernels([data_folder / "isd" / "N1702360370_1" / "kernels"], "CASSINI_ISS_NAC")
    assert cassini.focal_length_mm == 2003.44
    assert cassini.at("CL1/GRN").focal_length_mm == 2002.75
    assert cassini.at("CL1/GRN").focal_length_px == pytest.approx(2002.75 / 0.012)
    assert cassini.at("no such filter") is cassini
    mdis = Camera.from_kernels([data_folder / "isd" / "EN1072174528M" / "kernels"], -236820)
    assert mdis.at(temperature_c=4.07).focal_length_mm == pytest.approx(549.5535053027719, rel=1e-12)
    again = camera_from_dict(mdis.model_dump(exclude_unset=True), "again")
    assert again.at(temperature_c=-20.0).focal_length_mm == mdis.at(temperature_c=-20.0).focal_length_mm
