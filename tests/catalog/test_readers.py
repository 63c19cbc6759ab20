"""What the readers make of sound files; all of them are made here."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy.io import fits
from numpy.typing import NDArray
from PIL import Image
from small_vicar import vicar_file

from catalog.camera import known_cameras
from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers import read_frame
from catalog.readers.gaps import MIN_ZERO_RUN_PX, border_zeros, zero_filled
from catalog.readers.names import camera_of_names, target_of_label
from catalog.times import et_from_utc

RNG = np.random.default_rng(4)
FLIGHT_LABEL = (
    " LAB01='77                   800     800 800 800 L 1                          SC'"
    "  LAB02='VGR-2   FDS 20650.22   PICNO 0482J2-001   SCET 79.190 13:00:10         C'"
    "  LAB03='WA CAMERA  EXP 00480.0 MSEC  FILT 3(ORANGE)  LO GAIN  SCAN RATE  1:1   C'"
)


def fits_file(path: Path, *planes: tuple[str, NDArray[Any]], **keywords: Any) -> Path:
    """A FITS file; the first plane is the primary image."""
    hdus = [fits.PrimaryHDU(planes[0][1]), *(fits.ImageHDU(data, name=name) for name, data in planes[1:])]
    for key, value in keywords.items():
        hdus[0].header[key.replace("_", "-")] = value
    fits.HDUList(hdus).writeto(path)
    return path


@pytest.mark.parametrize("kind", ["u1", "<i2", ">i2", "<i4", ">i4", "<f4"])
def test_vicar_pixels_come_back_whatever_the_prefix_and_byte_order(kind: str, tmp_path: Path) -> None:
    pixels = RNG.integers(1, 200, (30, 40)).astype(kind)
    frame = read_frame(vicar_file(tmp_path / "a.img", pixels, prefix=24, header_lines=3))
    assert np.array_equal(frame.observation.image, pixels.astype(np.float32))
    assert frame.camera is None
    assert frame.target is None
    assert frame.et is None


def test_vax_floats_are_converted(tmp_path: Path) -> None:
    import vax

    pixels = RNG.normal(0, 1e3, (20, 30)).astype("<f4")
    path = vicar_file(tmp_path / "a.img", pixels)
    content = path.read_bytes().replace(b"REALFMT='RIEEE'", b"REALFMT='VAX'  ")
    path.write_bytes(content[:4096] + vax.to_vax32_bytes(pixels))
    assert np.allclose(read_frame(path).observation.image, pixels, rtol=1e-6)


def test_a_camera_is_found_by_its_label_names_alone(tmp_path: Path) -> None:
    pixels = RNG.integers(5, 200, (1024, 1024)).astype("u1")
    pixels[100] = 0
    pixels[5, 5] = 255
    keywords = (
        "PROPERTY='X' INSTRUMENT_HOST_NAME='CASSINI ORBITER' INSTRUMENT_ID='ISSNA' TARGET_NAME='ENCELADUS' "
        "IMAGE_MID_TIME='2005-068T04:09:09.568Z' EXPOSURE_DURATION=1200.0 FILTER_NAME=('CL1','IR3')"
    )
    frame = read_frame(vicar_file(tmp_path / "a.img", pixels, keywords, prefix=24))
    assert (frame.camera, frame.target, frame.exposure_s, frame.filter) == ("cassini-nac", "enceladus", 1.2, "CL1/IR3")
    assert frame.et == et_from_utc("2005-068T04:09:09.568")
    assert (frame.observation.quality[100] == Quality.MISSING).all()
    assert frame.observation.quality[5, 5] == Quality.SATURATED
    assert np.count_nonzero(frame.observation.quality) == 1024 + np.count_nonzero(
        pixels[:100] == 255
    ) + np.count_nonzero(pixels[101:] == 255)


def test_galileo_window_west_longitude_and_one_based_pixels_are_converted(tmp_path: Path) -> None:
    keywords = (
        "MISSION='GALILEO' SENSOR='SSI' TARGET='IO' SCETYEAR=1996 SCETDAY=251 SCETHOUR=1 SCETMIN=2 SCETSEC=3 "
        "SCETMSEC=4 FILTER=1 EXP=45.5 CUT_OUT_WINDOW=(11,21,100,200) TARGET_CENTER_DISTANCE=1000000.0 "
        "SUB_SPACECRAFT_LATITUDE=1.0 SUB_SPACECRAFT_LONGITUDE=10.0 SUB_SOLAR_LATITUDE=2.0 SUB_SOLAR_LONGITUDE=350.0 "
        "NORAZ=270.0 SUNAZ=180.0 SUB_SPACECRAFT_SAMPLE=100.0 SUB_SPACECRAFT_LINE=50.0 SOLRANGE=7.0e8 PHA=60.0"
    )
    pixels = RNG.integers(5, 200, (800, 800)).astype("u1")
    frame = read_frame(vicar_file(tmp_path / "a.img", pixels, keywords, prefix=200, header_lines=2))
    inside = np.zeros((800, 800), bool)
    inside[10:110, 20:220] = True
    assert np.array_equal((frame.observation.quality & Quality.OUTSIDE_WINDOW) == 0, inside)
    assert frame.et == et_from_utc("1996-251T01:02:03.004")
    assert (frame.camera, frame.filter, frame.exposure_s) == ("galileo-ssi", "GREEN", 0.0455)
    geometry = frame.label_geometry or {}
    assert (geometry["sub_spacecraft_lon_deg"], geometry["sub_solar_lon_deg"]) == (350.0, 10.0)
    assert (geometry["centre_x_px"], geometry["centre_y_px"]) == (99.0, 49.0)
    assert read_frame(frame.path, target="europa").label_geometry is None


def test_galileo_without_known_geometry_gives_none(tmp_path: Path) -> None:
    keywords = "MISSION='GALILEO' SENSOR='SSI' TARGET='IO' NORAZ=-999.0 SUB_SPACECRAFT_LONGITUDE=10.0"
    frame = read_frame(vicar_file(tmp_path / "a.img", np.ones((800, 800), "u1"), keywords, prefix=200))
    assert frame.label_geometry is None


def test_old_voyager_label_with_two_dimensions_is_read(tmp_path: Path) -> None:
    pixels = RNG.integers(5, 200, (800, 800)).astype("u1")
    path = vicar_file(tmp_path / "a.raw", pixels, FLIGHT_LABEL)
    path.write_bytes(path.read_bytes().replace(b"DIM=3", b"DIM=2").replace(b"TYPE='IMAGE'", b"TYPE='IMAG' "))
    frame = read_frame(path)
    assert (frame.camera, frame.filter, frame.exposure_s) == ("voyager2-wac", "ORANGE", 0.48)
    assert frame.et == pytest.approx(et_from_utc("1979-190T13:00:09.760"), abs=1e-6)
    assert frame.label["PICNO"] == "0482J2-001"
    assert not frame.undistorted


def test_voyager_object_space_is_undistorted_and_its_empty_rim_flagged(tmp_path: Path) -> None:
    pixels = RNG.integers(5, 2000, (1000, 1000)).astype("<i2")
    pixels[:, :20] = 0
    pixels[500, 500] = 0
    frame = read_frame(vicar_file(tmp_path / "a.geo", pixels, FLIGHT_LABEL))
    assert frame.undistorted
    outside = (frame.observation.quality & Quality.OUTSIDE_WINDOW) != 0
    assert outside[:, :20].all()
    assert outside.sum() == 20_000


def test_detached_label_gives_the_middle_of_start_and_stop(tmp_path: Path) -> None:
    vicar_file(tmp_path / "C1_RAW.IMG", RNG.integers(5, 99, (800, 800)).astype("u1"), FLIGHT_LABEL)
    (tmp_path / "C1_RAW.LBL").write_text(
        'PDS_VERSION_ID = PDS3\nTARGET_NAME = "GANYMEDE"\nSTART_TIME = 1979-07-09T13:00:00.00\n'
        "STOP_TIME = 1979-07-09T13:00:04.00\nOBJECT = IMAGE\n LINES = 800\nEND_OBJECT = IMAGE\nEND\n"
    )
    frame = read_frame(tmp_path / "C1_RAW.IMG")
    assert frame.et == pytest.approx(et_from_utc("1979-07-09T13:00:02"), abs=1e-6)
    assert frame.target == "ganymede"
    (tmp_path / "C1_RAW.LBL").write_text("= = START_TIME (")
    assert "PDS_LABEL_FAULT" in read_frame(tmp_path / "C1_RAW.IMG").label


def test_our_simulated_fits_brings_noise_quality_and_metadata(tmp_path: Path) -> None:
    image = RNG.normal(50, 2, (800, 800)).astype(np.float32)
    image[3, 4] = np.nan
    noise = np.full((800, 800), 2.5, np.float32)
    noise[0, 0] = 0
    quality = np.zeros((800, 800), np.uint16)
    quality[7, 8] = Quality.RESEAU
    path = fits_file(
        tmp_path / "s.fits",
        ("", image),
        ("NOISE", noise),
        ("QUALITY", quality),
        CAMERA="galileo-ssi",
        TARGET="Europa",
        ORIGIN="planetpose",
        DATE_AVG="2000-05-22T23:52:05.277",
        EXPTIME=0.05,
    )
    frame = read_frame(path)
    assert (frame.camera, frame.target, frame.exposure_s) == ("galileo-ssi", "europa", 0.05)
    assert frame.et == et_from_utc("2000-05-22T23:52:05.277")
    flags = frame.observation.quality
    assert (flags[3, 4], flags[7, 8], np.count_nonzero(flags)) == (Quality.MISSING, Quality.RESEAU, 2)
    assert frame.observation.image[3, 4] == 0
    assert frame.observation.image[10, 20] == image[10, 20]
    assert frame.observation.noise[5, 5] == 2.5
    assert frame.observation.noise[0, 0] == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize(
    ("suffix", "kind"), [("png", "u1"), ("png", "<u2"), ("tif", "u1"), ("tif", "<u2"), ("tif", "<i4"), ("tif", "<f4")]
)
def test_grey_pictures_are_read(suffix: str, kind: str, tmp_path: Path) -> None:
    pixels = RNG.integers(1, 250, (50, 60)).astype(kind)
    Image.fromarray(pixels).save(tmp_path / f"a.{suffix}")
    frame = read_frame(tmp_path / f"a.{suffix}", target="Io")
    assert np.array_equal(frame.observation.image, pixels.astype(np.float32))
    assert (frame.camera, frame.target, frame.et) == (None, "io", None)


def test_a_fits_axis_of_length_one_does_not_make_a_cube(tmp_path: Path) -> None:
    pixels = RNG.random((1, 20, 30)).astype(np.float32)
    frame = read_frame(fits_file(tmp_path / "a.fits", ("", pixels)))
    assert np.array_equal(frame.observation.image, pixels[0])


def test_the_noise_of_a_picture_is_measured(tmp_path: Path) -> None:
    y, x = np.mgrid[:300, :300]
    disk = np.where(np.hypot(x - 150, y - 150) < 100, 100 + 0.3 * x, 10)
    Image.fromarray((disk + RNG.normal(0, 3, disk.shape)).astype(np.float32)).save(tmp_path / "a.tif")
    assert read_frame(tmp_path / "a.tif").observation.noise[0, 0] == pytest.approx(3, rel=0.03)


def camera_file(path: Path, **content: Any) -> str:
    """A camera file of the size of Galileo's; content: what else it says."""
    lines = {"name": "mine", "size_px": [800, 800], "centre_px": [399.5, 399.5], "focal_length_px": 98500.0} | content
    path.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in lines.items()))
    return str(path)


def test_a_camera_or_target_that_contradicts_the_label_is_reported(tmp_path: Path) -> None:
    path = fits_file(tmp_path / "a.fits", ("", np.ones((800, 800), np.uint8)), CAMERA="galileo-ssi", TARGET="EUROPA")
    frame = read_frame(path, camera="voyager1-nac", target="io")
    assert (frame.camera, frame.target) == ("voyager1-nac", "io")
    assert frame.overruled == (
        "the label says camera galileo-ssi, --camera voyager1-nac is used",
        "the label says target europa, --target io is used",
    )
    other = read_frame(path, camera=camera_file(tmp_path / "other.toml", naif_instrument_id=-31101))
    assert other.overruled == ("the label says camera galileo-ssi, --camera mine is used",)


def test_who_names_the_same_instrument_or_what_the_label_does_not_say_is_not_bothered(tmp_path: Path) -> None:
    image = ("", np.ones((800, 800), np.uint8))
    path = fits_file(tmp_path / "a.fits", image, CAMERA="galileo-ssi", TARGET="EUROPA")
    refined: tuple[dict[str, Any], ...] = (
        {}, {"name": "galileo-ssi"}, {"naif_instrument_id": -77036}, {"label_names": ["Galileo/SSI"]},
    )  # fmt: skip
    cameras = [camera_file(tmp_path / f"{n}.toml", **content) for n, content in enumerate(refined)]
    for camera in (None, "galileo-ssi", "Galileo-SSI", *cameras):
        assert read_frame(path, camera, "502").overruled == (), camera
    assert read_frame(fits_file(tmp_path / "b.fits", image), "voyager1-nac", "io").overruled == ()


def test_a_frame_that_has_not_the_size_of_another_camera_than_its_label_s_is_refused_saying_so(tmp_path: Path) -> None:
    path = fits_file(tmp_path / "a.fits", ("", np.ones((800, 800), np.uint8)), CAMERA="galileo-ssi")
    with pytest.raises(RefusedError, match="First of all: the label says camera galileo-ssi, --camera newhorizons"):
        read_frame(path, camera="newhorizons-lorri")


def test_a_frame_of_the_wrong_size_is_refused_with_both_sizes(tmp_path: Path) -> None:
    path = vicar_file(tmp_path / "a.img", np.ones((400, 410), "u1"), "MISSION='GALILEO' SENSOR='SSI'")
    with pytest.raises(RefusedError, match=r"410x400 pixels, camera galileo-ssi has 800x800.*--window") as refusal:
        read_frame(path)
    assert refusal.value.code == "frame-size"
    own = tmp_path / "own.toml"
    own.write_text('name = "own"\nsize_px = [410, 400]\ncentre_px = [199.5, 199.5]\nfocal_length_px = 50000.0\n')
    assert read_frame(path, camera=str(own)).observation.image.shape == (400, 410)


def test_cubes_and_archives_are_refused_with_a_remedy(tmp_path: Path) -> None:
    fits_file(tmp_path / "cube.fits", ("", np.zeros((3, 9, 9), np.float32)))
    (tmp_path / "a.fits.gz").write_bytes(b"\x1f\x8b" + bytes(50))
    (tmp_path / "a.zip").write_bytes(b"PK\3\4" + bytes(50))
    (tmp_path / "a.txt").write_text("no image\n")
    (tmp_path / "empty").touch()
    expected = {"cube.fits": "several-planes", "a.fits.gz": "image-unreadable", "a.zip": "image-format-unknown"}
    expected |= {"a.txt": "image-format-unknown", "empty": "image-format-unknown", ".": "image-is-folder"}
    expected |= {"absent.img": "image-missing"}
    for name, code in expected.items():
        with pytest.raises(RefusedError) as refusal:
            read_frame(tmp_path / name)
        assert refusal.value.code == code
        assert str(tmp_path / name) in refusal.value.fault
        assert refusal.value.remedy


def test_every_catalog_camera_can_be_found_by_each_of_its_label_names() -> None:
    for camera in known_cameras().values():
        for name in camera.label_names:
            assert camera_of_names([name.lower()], camera.detector_size_px) == camera.name


def test_target_spellings() -> None:
    assert target_of_label("ENCELADU") == "enceladus"  # Voyager's labels cut names after eight characters
    assert target_of_label(" EUROPA ") == "europa"
    assert target_of_label("2002 JF56") == "2002 jf56"
    assert target_of_label("N/A") is None
    assert target_of_label(None) is None


def test_runs_of_zeros_are_missing_but_reseau_marks_are_not() -> None:
    image = np.full((20, 100), 9, np.uint8)
    image[3, 10 : 10 + MIN_ZERO_RUN_PX] = 0
    image[5, 50 : 50 + MIN_ZERO_RUN_PX - 1] = 0
    image[7] = 0
    missing = zero_filled(image)
    assert missing.sum() == MIN_ZERO_RUN_PX + 100
    assert not missing[5].any()
    assert not border_zeros(image)[5].any()


def test_a_sky_of_exact_zeros_is_not_missing_but_for_whole_lines() -> None:
    image = (RNG.random((40, 100)) > 0.3).astype(np.uint8)
    image[:, 50:70] = 0
    image[11] = 0
    assert zero_filled(image).sum() == 100


@pytest.mark.parametrize("scale", [1, 100])
def test_whole_numbers_beyond_the_cameras_saturation_are_not_its_data_numbers(tmp_path: Path, scale: int) -> None:
    """A 16-bit picture of an 8-bit camera: nothing in it is saturated, and its noise is measured."""
    pixels = RNG.normal(120, 2, (800, 800)).round().clip(0, 254)
    pixels[:3] = 255
    path = tmp_path / "scaled.png"
    Image.fromarray((pixels * scale).astype(np.uint16)).save(path)
    observation = read_frame(path, camera="galileo-ssi", target="europa").observation
    saturated = (observation.quality & Quality.SATURATED) > 0
    assert saturated.sum() == (3 * 800 if scale == 1 else 0)
    if scale > 1:
        assert np.median(observation.noise) == pytest.approx(2 * scale, rel=0.2)
