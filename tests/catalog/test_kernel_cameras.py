"""Cameras from instrument kernels: every convention of the keywords, on small kernels of its kind."""

from pathlib import Path

import numpy as np
import pytest
import spiceypy

from catalog.camera import Camera, camera_from_dict
from catalog.camera_store import camera_as_file, camera_of
from catalog.conditions import temperature_of_label
from catalog.errors import RefusedError

BASE = {
    "FOCAL_LENGTH": "100.0",
    "PIXEL_SAMPLES": "1024",
    "PIXEL_LINES": "1000",
    "TRANSX": "(0.0 0.01 0.0)",
    "TRANSY": "(0.0 0.0 0.01)",
    "BORESIGHT_SAMPLE": "500.0",
    "BORESIGHT_LINE": "400.0",
}
COVER_OFF = 0.0


def kernel(folder: Path, changes: dict[str, str | None], naif_id: int = -77700, more: str = "") -> Path:
    keywords = {key: value for key, value in (BASE | changes).items() if value is not None}
    lines = "\n".join(f"INS{naif_id}_{key} = {value}" for key, value in keywords.items())
    names = f"NAIF_BODY_NAME += ( 'TEST_CAM' )\nNAIF_BODY_CODE += ( {naif_id} )"
    file = folder / "test.ti"
    file.write_text(f"KPL/IK\n\\begindata\n{names}\n{lines}\n{more}\n\\begintext\n")
    return file


def made(folder: Path, changes: dict[str, str | None], **conditions: object) -> Camera:
    return Camera.from_kernels([kernel(folder, changes)], "TEST_CAM", **conditions)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "origin"),
    [
        ({}, (499.0, 399.0)),  # ISIS counts from 1
        ({"BORESIGHT_SAMPLE": "511.5", "BORESIGHT_LINE": "499.5"}, (511.5, 499.5)),  # the middle, counted from 0
        ({"BORESIGHT_SAMPLE": None, "BORESIGHT_LINE": None, "CCD_CENTER": "(511.5 499.5)"}, (511.5, 499.5)),
        ({"BORESIGHT_SAMPLE": None, "BORESIGHT_LINE": None, "CCD_CENTER": "(512.5 500.5)"}, (511.5, 499.5)),
        ({"BORESIGHT_SAMPLE": None, "BORESIGHT_LINE": None, "CCD_CENTER": "(486.2 450.3)"}, (486.2, 450.3)),
        ({"BORESIGHT_SAMPLE": None, "BORESIGHT_LINE": None, "FOV_CENTER_PIXEL": "(511.5 499.5)"}, (511.5, 499.5)),
        ({"BORESIGHT_SAMPLE": None, "BORESIGHT_LINE": None}, (511.5, 499.5)),  # nothing said: the middle
    ],
)
def test_the_boresights_pixel_is_counted_as_its_keyword_counts(
    changes: dict[str, str | None], origin: tuple[float, float], tmp_path: Path
) -> None:
    camera = made(tmp_path, changes)
    assert camera.focal_plane is not None
    assert camera.focal_plane.origin_px == origin
    assert camera.detector_ray(origin) == pytest.approx([0, 0, 1])


@pytest.mark.parametrize(
    ("changes", "focal_length_mm"),
    [
        ({}, 100.0),
        ({"FOCAL_LENGTH": "0.1208"}, 120.8),
        ({"FOCAL_LENGTH": "2.6", "FOCAL_LENGTH_UNITS": "'m'"}, 2600.0),
        ({"FOCAL_LENGTH": "2.6", "FOCAL_LENGTH_UNITS": "'mm'"}, 2.6),
    ],
)
def test_focal_lengths_are_millimetres(changes: dict[str, str | None], focal_length_mm: float, tmp_path: Path) -> None:
    assert made(tmp_path, changes).focal_length_mm == pytest.approx(focal_length_mm, rel=1e-12)


@pytest.mark.parametrize(
    ("size", "pitch_mm"), [("12", 0.012), ("0.012", 0.012), ("0.000012", 0.012), ("(14.004 13.995)", 0.013999499)]
)
def test_a_pixels_size_may_be_in_micrometres_millimetres_or_metres(size: str, pitch_mm: float, tmp_path: Path) -> None:
    camera = made(tmp_path, {"TRANSX": None, "TRANSY": None, "PIXEL_SIZE": size})
    assert camera.pixel_pitch_mm == pytest.approx(pitch_mm)


def test_the_inverse_affine_serves_alone(tmp_path: Path) -> None:
    forward = made(tmp_path, {"TRANSX": "(0.1 0.01 0.001)", "TRANSY": "(-0.2 0.002 0.012)"})
    inverse = np.linalg.inv([[0.01, 0.001], [0.002, 0.012]])
    shift = -inverse @ [0.1, -0.2]
    rows = [f"({c:.17g} {a:.17g} {b:.17g})" for c, (a, b) in zip(shift, inverse, strict=True)]
    backward = made(tmp_path, {"TRANSX": None, "TRANSY": None, "ITRANSS": rows[0], "ITRANSL": rows[1]})
    pixels = np.array([[3.0, 7.0], [900.0, 800.0]])
    assert backward.detector_ray(pixels) == pytest.approx(forward.detector_ray(pixels), abs=1e-12)


def test_pixels_that_are_not_square_make_a_square_undistorted_frame(tmp_path: Path) -> None:
    """NEAR MSI's raw pixels: 537 x 244 of them, 16.1 x 27.2 micrometres."""
    changes = {"TRANSX": "(0 0.0161 0)", "TRANSY": "(0 0 -0.0272)", "PIXEL_SAMPLES": "537", "PIXEL_LINES": "244"}
    changes |= {"BORESIGHT_SAMPLE": "269.0", "BORESIGHT_LINE": "122.5"}
    camera = made(tmp_path, changes)
    assert camera.detector_size_px == (537, 244)
    assert camera.size_px == (537, 413)  # 244 * 272 / 161 = 412.2
    there = camera.project(camera.detector_ray(np.array([[0, 0], [0, 243], [536, 0], [536, 243]], float)))
    assert (there >= -0.5).all()
    assert (there <= np.array(camera.size_px) - 0.5 + 1).all()
    assert there[0, 1] > there[1, 1]  # lines run upwards


@pytest.mark.parametrize(
    ("keywords", "model"),
    [
        ({"OD_K": "(0 -8.0e-6 0)"}, "radial-series"),
        ({"K1": "-2.5e-5"}, "radial-series"),
        ({"OD_K": "(1.014 2.9e-7 -1.4e-13)"}, "radial-series"),
        ({"RAD_DIST_COEFF": "8.4e-6"}, "radial-outward"),
        ({"DISTORTION_K1": "-5.96e-8", "DISTORTION_K2": "2.7e-14"}, "radial-outward"),
        ({"OD_K": "(0 -2.4e-5 0)", "DECENTER": "(2e-5 2e-5)", "PP": "(0 0)"}, "radial-decentered"),
        ({"OD_K_PAN": "(2e-5 1.7e-4 6e-5 0 0)", "OD_CENTER_PAN": "(486.2 450.3)"}, "radial-all-powers"),
        ({"OOC_EM": "(2.7e-5 -1.9e-5 -2.9e-5)"}, "lorri-em"),
        ({}, "none"),
    ],
)
def test_distortion_keywords_choose_the_model(keywords: dict[str, str | None], model: str, tmp_path: Path) -> None:
    camera = made(tmp_path, keywords, filter_name="PAN")
    assert camera.distortion.model == model
    pixels = np.random.default_rng(2).uniform(0, 1000, (30, 2))
    assert camera.detector_pixel(camera.detector_ray(pixels)) == pytest.approx(pixels, abs=1e-6)


def test_hayabusa2s_coefficients_multiply_in_pixels(tmp_path: Path) -> None:
    """r' = r (L0 + L1 r^2 + L2 r^4), r in pixels (Suzuki et al. 2018)."""
    camera = made(tmp_path, {"OD_K": "(1.014 2.933e-7 -1.384e-13)"})
    r = 300.0
    x, _, z = camera.detector_ray([499.0 + r, 399.0])
    expected = r * (1.014 + 2.933e-7 * r**2 - 1.384e-13 * r**4) * 0.01 / 100.0
    assert x / z == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("transy", ["(0 0 0.0022)", "(0 0 -0.0022)"])
def test_opencvs_model_is_applied_along_samples_and_lines(transy: str, tmp_path: Path) -> None:
    """OSIRIS-REx TAGCAMS, against OpenCV itself: pixel (1-based) of a direction, whatever the focal plane's axes."""
    import cv2

    k, p, c, f = (-0.53766, 0.37526, -0.18368), (2.3e-4, 9.1e-4), (512.0, 480.0), (3473.26, 3473.321)
    camera = made(
        tmp_path,
        {
            "TRANSX": "(0 0.0022 0)", "TRANSY": transy, "FOCAL_LENGTH": "0.00764", "DISTORTION_MODEL": "'OPENCV'",
            "OPENCV_OD_K": str((*k, 0, 0, 0)).replace(",", ""), "OPENCV_OD_P": str(p).replace(",", ""),
            "OPENCV_OD_C": str(c).replace(",", ""), "OPENCV_OD_F": str(f).replace(",", ""),
        },
    )  # fmt: skip
    rays = camera.detector_ray(np.array([[511.0, 479.0], [100.0, 200.0], [900.0, 700.0]]))
    up = "-" in transy
    tangents = rays[:, :2] / rays[:, 2:] * [1, -1 if up else 1]
    matrix = np.array([[f[0], 0, c[0]], [0, f[1], c[1]], [0, 0, 1]])
    points = np.column_stack([tangents, np.ones(3)])[:, None]
    seen = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array([*k[:2], *p, k[2]]))[0][:, 0]
    assert seen - 1 == pytest.approx(np.array([[511.0, 479.0], [100.0, 200.0], [900.0, 700.0]]), abs=1e-6)


def test_keywords_that_go_into_no_model_are_named(tmp_path: Path) -> None:
    sources = made(tmp_path, {"OD_STRANGE": "(1 2 3)"}).sources
    assert "not used: OD_STRANGE" in sources
    assert any("INS-77700_FOCAL_LENGTH" in source and "test.ti" in source for source in sources)


def test_a_pixels_size_that_contradicts_the_affine_is_named(tmp_path: Path) -> None:
    """Dawn FC: 14.0088 x 14 micrometres by ISIS' addendum, 14.004 x 13.995 by the IK."""
    dawn = {"TRANSX": "(0 0.0140088 0)", "TRANSY": "(0 0 0.014)", "PIXEL_SIZE": "(14.004 13.995)"}
    assert any("0.014004 x 0.013995" in source for source in made(tmp_path, dawn).sources)
    same = {"TRANSX": "(0 0.014 0)", "TRANSY": "(0 0 0.014)", "PIXEL_SIZE": "14"}
    assert not any("contradiction" in source for source in made(tmp_path, same).sources)


def test_a_framelet_is_a_part_of_the_detector(tmp_path: Path) -> None:
    """JunoCam's offset counts lines from 1; CaSSIS has a boresight line in the middle of each filter."""
    offset = "INS-77704_FILTER_SAMPLES = 1024\nINS-77704_FILTER_LINES = 128\nINS-77704_FILTER_OFFSET = 285"
    file = kernel(tmp_path, {}, more=offset)
    whole, framelet = (Camera.from_kernels([file], naif_id) for naif_id in (-77700, -77704))
    assert framelet.detector_size_px == (1024, 128)
    assert framelet.detector_ray([10.0, 20.0]) == pytest.approx(whole.detector_ray([10.0, 20.0 + 284.0]), abs=1e-12)
    middle = "INS-77704_FILTER_SAMPLES = 1024\nINS-77704_FILTER_LINES = 256\nINS-77704_BORESIGHT_LINE = 839.5"
    framelet = Camera.from_kernels([kernel(tmp_path, {}, more=middle)], -77704)
    assert framelet.detector_ray([10.0, 127.5]) == pytest.approx(whole.detector_ray([10.0, 838.5]), abs=1e-12)


def test_the_look_along_minus_z_turns_the_frame_and_not_the_sky(tmp_path: Path) -> None:
    """New Horizons LORRI: pixels (x, y) see the direction (x, y, -f) of the instrument's frame."""
    camera = made(tmp_path, {"BORESIGHT": "(0 0 -1)"})
    rotation = np.array(camera.camera_from_instrument, float)
    assert np.linalg.det(rotation) == pytest.approx(1)
    assert rotation.T @ camera.detector_ray([509.0, 419.0]) == pytest.approx(
        np.array([0.1, 0.2, -100.0]) / np.linalg.norm([0.1, 0.2, 100.0]), abs=1e-12
    )


def test_frames_lead_to_the_platform_that_moves(tmp_path: Path) -> None:
    frames = """
    FRAME_TEST_CAM = -77700
    FRAME_-77700_NAME = 'TEST_CAM'
    FRAME_-77700_CLASS = 4
    FRAME_-77700_CLASS_ID = -77700
    FRAME_-77700_CENTER = -777
    TKFRAME_-77700_RELATIVE = 'TEST_BUS'
    TKFRAME_-77700_SPEC = 'ANGLES'
    TKFRAME_-77700_UNITS = 'DEGREES'
    TKFRAME_-77700_AXES = (1 2 3)
    TKFRAME_-77700_ANGLES = (10 20 30)
    FRAME_TEST_BUS = -777000
    FRAME_-777000_NAME = 'TEST_BUS'
    FRAME_-777000_CLASS = 3
    FRAME_-777000_CLASS_ID = -777000
    FRAME_-777000_CENTER = -777
    """
    camera = Camera.from_kernels([kernel(tmp_path, {}, more=frames)], "TEST_CAM")
    assert (camera.instrument_frame, camera.naif_ck_frame) == ("TEST_CAM", "TEST_BUS")
    assert (camera.naif_ck_id, camera.naif_spacecraft_id) == (-777000, -777)
    assert spiceypy.ktotal("ALL") == 0  # the pool is as it was


@pytest.mark.parametrize("missing", ["FOCAL_LENGTH", "PIXEL_SAMPLES", "TRANSX"])
def test_a_missing_keyword_is_named(missing: str, tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match=missing):
        made(tmp_path, {missing: None})
    if missing == "PIXEL_SAMPLES":
        assert made(tmp_path, {missing: None}, size_px=(800, 600)).size_px == (800, 600)


def test_a_line_scanner_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match="line scanner"):
        made(tmp_path, {"PIXEL_LINES": "1"})


def test_a_made_camera_is_a_file_that_every_process_reads_alike(tmp_path: Path) -> None:
    file = kernel(tmp_path, {"OD_K": "(0 -8.0e-6 0)", "CL1_GRN_FOCAL_LENGTH": "99.5"})
    camera = camera_of("kernels:TEST_CAM", [file])
    path = camera_as_file("kernels:TEST_CAM", [file], tmp_path / "cameras")
    from catalog.camera import find_camera

    assert find_camera(str(path)) == camera
    assert camera_as_file("kernels:TEST_CAM", [file], tmp_path / "cameras") == path
    assert find_camera(str(path)).at("CL1/GRN").focal_length_mm == 99.5


@pytest.mark.parametrize("name", ["kernels:", "isd:", "isd:nowhere.json", "isis:nowhere.cub", "kernels:NOBODY"])
def test_what_makes_no_camera_says_why(name: str, tmp_path: Path) -> None:
    with pytest.raises(RefusedError) as refused:
        camera_of(name, [kernel(tmp_path, {})])
    assert refused.value.remedy


@pytest.mark.parametrize(
    ("label", "celsius"),
    [
        ({"FOCAL_PLANE_TEMPERATURE": "4.07 <DEGC>"}, 4.07),
        ({"FocalPlaneTemperature": "270.227 <K>"}, -2.923),
        ({"FOCAL_PLANE_TEMPERATURE": "Quantity(value=270.15, units='K')"}, -3.0),
        ({"FOCAL_PLANE_TEMPERATURE": -26.7}, -26.7),
        ({"FOCAL_PLANE_TEMPERATURE": "N/A"}, None),
        ({"FOCAL_PLANE_TEMPERATURE": -999.0}, None),
        ({}, None),
    ],
)
def test_the_focal_planes_temperature(label: dict[str, object], celsius: float | None) -> None:
    assert temperature_of_label(label) == (None if celsius is None else pytest.approx(celsius))


def test_a_filter_of_a_camera_file_changes_what_it_says() -> None:
    content = {"name": "c", "size_px": (9, 9), "centre_px": (4, 4), "focal_length_mm": 9.0, "pixel_pitch_mm": 0.01}
    camera = camera_from_dict(content | {"filters": {"RED_CL2": {"focal_length_mm": 10.0}}}, "c")
    assert camera.at("RED/CL2").focal_length_px == pytest.approx(1000.0)
    assert camera.at("GRN") is camera
