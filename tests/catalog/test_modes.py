"""Summing and windows: recognised by label or size, or given; the picture lies in the camera's frame where it was."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy.io import fits
from formats import isis_cube
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from small_vicar import vicar_file

from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.flips import PLACES, Flip, flipped
from catalog.image_mode import FULL_FRAME, ImageMode
from catalog.observation import Frame, Quality
from catalog.readers import read_frame
from catalog.readers.keywords import facts_of_keywords
from catalog.readers.names import target_of_label, targets_of_label
from catalog.readers.stated_mode import stated_mode

RNG = np.random.default_rng(4)
SSI = "MISSION='GALILEO' SENSOR='SSI' TARGET='IO'"
ISS = "INSTRUMENT_HOST_NAME='CASSINI ORBITER' INSTRUMENT_ID='ISSNA'"


def picture(lines: int, samples: int) -> NDArray[Any]:
    return RNG.integers(3, 200, (lines, samples)).astype("u1")


def npy(folder: Path, pixels: NDArray[Any]) -> Path:
    np.save(folder / "a.npy", pixels)
    return folder / "a.npy"


def lies_at(frame: Frame, pixels: NDArray[Any], x: int, y: int) -> None:
    """The picture is at (x, y) of the frame, and all around it is OUTSIDE_WINDOW."""
    part = (slice(y, y + pixels.shape[0]), slice(x, x + pixels.shape[1]))
    assert np.array_equal(frame.observation.image[part], pixels)
    outside = frame.observation.quality & Quality.OUTSIDE_WINDOW > 0
    assert not outside[part].any()
    assert outside.sum() == outside.size - pixels.size


@pytest.mark.parametrize("summing", [2, 4])
@pytest.mark.parametrize("camera", ["galileo-ssi", "cassini-nac", "voyager1-nac"])
def test_summed_frames_are_known_by_their_size(camera: str, summing: int, tmp_path: Path) -> None:
    nx, ny = find_camera(camera).detector_size_px
    pixels = picture(ny // summing, nx // summing)
    frame = read_frame(npy(tmp_path, pixels), camera=camera)
    assert (frame.mode.summing, frame.mode.window) == (summing, None)
    assert np.array_equal(frame.observation.image, pixels)
    assert any("by the frame's size" in warning for warning in frame.warnings)


@pytest.mark.parametrize(("mode", "summing"), [("SUM2", 2), ("SUM4", 4), ("FULL", 1)])
def test_cassinis_modes_are_in_the_label(mode: str, summing: int, tmp_path: Path) -> None:
    side = 1024 // summing
    path = vicar_file(tmp_path / "a.img", picture(side, side), f"{ISS} INSTRUMENT_MODE_ID='{mode}'")
    frame = read_frame(path)
    assert frame.mode.summing == summing
    assert frame.sources.get("mode", "INSTRUMENT_MODE_ID") == "INSTRUMENT_MODE_ID"
    assert not any("frame's size" in warning for warning in frame.warnings)


@pytest.mark.parametrize(
    ("word", "summing"),
    [("SUMMED", 2), ("SUMMATION", 2), ("PIXEL_SUMMATION", 2), ("UNSUMMED", None), ("NOT SUMMED", None), ("FULL", None)],
)
def test_words_for_summing(word: str, summing: int | None) -> None:
    assert stated_mode({"FRAME_MODE_ID": word}).summing == summing


def test_a_window_of_half_the_size_whose_place_the_label_states_is_not_summed(tmp_path: Path) -> None:
    pixels = picture(512, 512)
    path = vicar_file(tmp_path / "a.img", pixels, f"{ISS} FIRST_LINE=201 FIRST_LINE_SAMPLE=101")
    frame = read_frame(path)
    assert (frame.mode.summing, frame.mode.window) == (1, (100, 200, 512, 512))
    lies_at(frame, pixels, 100, 200)


@pytest.mark.parametrize("summing", [1, 2])
@pytest.mark.parametrize("flip", PLACES)
def test_a_stated_window_lies_in_a_flipped_picture_where_it_lies_in_the_flipped_frame(
    flip: Flip, summing: int, tmp_path: Path
) -> None:
    """As a whole frame of the same camera shows it, flipped in the same way."""
    side = 1024 // summing
    whole = picture(side, side)
    x, y, lines, samples = 30, 140, 200, 260
    cut = whole[y : y + lines, x : x + samples]
    keywords = f"{ISS} SUMMING_MODE={summing} FIRST_LINE={y * summing + 1} FIRST_LINE_SAMPLE={x * summing + 1}"
    frame = read_frame(vicar_file(tmp_path / "a.img", cut, keywords), flip=flip)
    inside = frame.observation.quality & Quality.OUTSIDE_WINDOW == 0
    assert inside.sum() == cut.size
    assert np.array_equal(frame.observation.image[inside], flipped(whole, flip)[inside])
    assert frame.mode.summing == summing


@pytest.mark.parametrize("telemetry", ["HIS", "AI8"])
def test_a_summed_frame_of_galileo_in_a_corner_of_a_full_one(telemetry: str, tmp_path: Path) -> None:
    pixels, whole = picture(400, 400), np.zeros((800, 800), "u1")
    whole[:400, :400] = pixels
    frame = read_frame(vicar_file(tmp_path / "a.img", whole, f"{SSI} TLMFMT='{telemetry}'"))
    assert (frame.mode.summing, frame.sources["mode"]) == (2, "TLMFMT")
    assert np.array_equal(frame.observation.image, pixels)


def test_lines_that_are_missing_at_the_end(tmp_path: Path) -> None:
    pixels = picture(430, 800)
    frame = read_frame(npy(tmp_path, pixels), camera="galileo-ssi")
    assert frame.mode.window == (0, 0, 800, 430)
    lies_at(frame, pixels, 0, 0)
    assert any("missing at the end" in warning for warning in frame.warnings)


@pytest.mark.parametrize("what", ["SCALE", "FOV"])
def test_fewer_lines_of_oblong_pixels_are_neither_missing_ones_nor_a_window(what: str, tmp_path: Path) -> None:
    sides = f"HORIZONTAL_PIXEL_{what}=0.03 VERTICAL_PIXEL_{what}=0.05"
    path = vicar_file(tmp_path / "a.img", picture(430, 800), f"{SSI} {sides}")
    with pytest.raises(
        RefusedError, match=r"1\.67 times as high as wide\. Resample .* 800x800 .*focal_plane"
    ) as refusal:
        read_frame(path)
    assert "--window" not in refusal.value.reason


@pytest.mark.parametrize("noise", [True, False])
def test_a_window_is_placed_where_the_user_says(noise: bool, tmp_path: Path) -> None:
    pixels = picture(100, 150)
    hdus = [fits.PrimaryHDU(pixels), *([fits.ImageHDU(np.full((100, 150), 2, "f4"), name="NOISE")] if noise else [])]
    fits.HDUList(hdus).writeto(tmp_path / "a.fits")
    mode = ImageMode(2, (40, 60, 300, 200), "--summing and --window")
    frame = read_frame(tmp_path / "a.fits", camera="galileo-ssi", mode=mode)
    assert frame.observation.image.shape == (400, 400)
    lies_at(frame, pixels, 20, 30)
    assert np.isfinite(frame.observation.noise).all()
    assert frame.mode == mode


@pytest.mark.parametrize(
    ("summing", "window", "fault"),
    [
        (1, (700, 0, 150, 100), "leaves 800x800"),
        (2, (0, 0, 150, 100), "is 75x50"),
        (2, (41, 60, 300, 200), "begins inside a pixel"),
        (1, None, "are 800x800"),
        (3, None, "are 266x266"),
    ],
)
def test_a_mode_that_cannot_be_is_refused(summing: int, window: Any, fault: str, tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match=rf"150x100 pixels.*{fault}.*--window") as refusal:
        read_frame(npy(tmp_path, picture(100, 150)), camera="galileo-ssi", mode=ImageMode(summing, window))
    assert refusal.value.code == "frame-mode"


def test_crops_and_reductions_of_isis_say_where_they_were(tmp_path: Path) -> None:
    def alpha(x: float, y: float, wide: float, high: float, lines: int, samples: int) -> str:
        return f"""  Group = AlphaCube
    AlphaSamples = 800\n AlphaLines = 800
    AlphaStartingSample = {x}\n AlphaStartingLine = {y}
    AlphaEndingSample = {x + wide}\n AlphaEndingLine = {y + high}
    BetaSamples = {samples}\n BetaLines = {lines}
  End_Group"""

    crop, reduced = picture(90, 120), picture(80, 266)
    (tmp_path / "crop.cub").write_bytes(isis_cube(crop[None], None, more=alpha(100.5, 40.5, 120, 90, 90, 120)))
    (tmp_path / "small.cub").write_bytes(isis_cube(reduced[None], None, more=alpha(0.5, 300.5, 800, 240, 80, 266)))
    frame = read_frame(tmp_path / "crop.cub", camera="galileo-ssi")
    assert (frame.mode.window, frame.sources["mode"]) == ((100, 40, 120, 90), "the group AlphaCube")
    lies_at(frame, crop, 100, 40)
    frame = read_frame(tmp_path / "small.cub", camera="galileo-ssi")
    assert (frame.mode.summing, frame.mode.window) == (3, (0, 300, 798, 240))
    lies_at(frame, reduced, 0, 100)


@pytest.mark.parametrize(
    "cards",
    [{"LTM1_1": 0.5, "LTM2_2": 0.5, "LTV1": -19.75, "LTV2": -29.75}, {"CCDSUM": "2 2"}, {"XBINNING": 2, "YBINNING": 2}],
)
def test_binning_in_fits_headers(cards: dict[str, Any], tmp_path: Path) -> None:
    """IRAF's LTM and LTV give each image pixel's place: x = LTM x_detector + LTV, both counted from 1."""
    pixels = picture(100, 150) if "LTV1" in cards else picture(400, 400)
    fits.PrimaryHDU(pixels, fits.Header(cards)).writeto(tmp_path / "a.fits")
    frame = read_frame(tmp_path / "a.fits", camera="galileo-ssi")
    assert frame.mode.summing == 2
    lies_at(frame, pixels, *((20, 30) if "LTV1" in cards else (0, 0)))


def test_a_full_frame_has_no_mode(tmp_path: Path) -> None:
    frame = read_frame(npy(tmp_path, picture(800, 800)), camera="galileo-ssi")
    assert frame.mode == FULL_FRAME
    assert str(frame.mode) == "full frame"
    assert frame.warnings == ()


@given(st.integers(1, 8), st.floats(0, 799), st.floats(0, 799))
def test_a_summed_camera_looks_where_its_detector_looks(summing: int, x: float, y: float) -> None:
    camera = find_camera("galileo-ssi")
    summed = camera.summed(summing)
    there = (np.array([x, y]) + 0.5) / summing - 0.5
    assert np.allclose(summed.ray(there), camera.ray([x, y]), atol=1e-14)
    assert summed.size_px == (800 // summing, 800 // summing)
    assert (summed.unsummed is None) == (summing == 1)


@pytest.mark.parametrize(
    ("stated", "name"),
    [
        ("*EUROPA*", "europa"), ("ENCELADU", "enceladus"), ("CALLIST", "callisto"), ("?", None), ("*SKY*", None),
        ("S RINGS", "saturn"), ("S_RINGS", "saturn"), ("RINGS OF URANUS", "uranus"), ("J RINGS", "jupiter"),
        ("N RINGS", "neptune"), ("SATURN RINGS", "saturn"), ("(4) VESTA", "vesta"), ("Bennu (101955)", "bennu"),
        ("951 GASPRA", "gaspra"), ("134340 PLUTO", "pluto"), ("1P/HALLEY", "halley"), ("P/Borrelly", "borrelly"),
        ("9P/TEMPEL 1", "tempel 1"), ("RHEA.", "rhea"), ("TITAN_", "titan"), ("MIMAS (SI)", "mimas"),
        ("EARTH'S MOON", "moon"), ("CAL LAMPS", None), ("67P/C-G", "67p/c-g"), ("S/2004 N 1", "s/2004 n 1"),
    ],
)  # fmt: skip
def test_targets_as_labels_spell_them(stated: str, name: str | None) -> None:
    assert target_of_label(stated) == name
    assert targets_of_label([stated, "IO"]) == (("io",) if name is None or "RINGS" in stated else (name, "io"))


@pytest.mark.parametrize(
    ("label", "seconds"),
    [
        ({"EXPOSURE_DURATION": 250.0}, 0.25),  # milliseconds, as PDS counts them
        ({"EXPOSURE_DURATION": 2.5, "START_TIME": "2000-01-01T00:00:00", "STOP_TIME": "2000-01-01T00:00:02.5"}, 2.5),
        ({"EXPOSURE_DURATION": [250.0, 250.0]}, 0.25),
        ({"EXPOSURE_DURATION": "N/A"}, None),
    ],
)
def test_exposures_without_a_unit(label: dict[str, Any], seconds: float | None) -> None:
    assert facts_of_keywords(label)["exposure_s"] == seconds


def test_each_value_says_where_it_came_from() -> None:
    label = {
        "INSTRUMENT_HOST_NAME": "CASSINI ORBITER", "INSTRUMENT_ID": "ISSNA", "TARGET_LIST": ["N/A", "TETHYS"],
        "START_TIME": "2000-01-01T00:00:00", "STOP_TIME": "2000-01-01T00:00:01", "EXPOSURE_DURATION": 1000.0,
        "FILTER_NAME": ["CL1", "IR3"], "GAIN_MODE_ID": "29 ELECTRONS PER DN", "SUMMING_MODE": 2, "FIRST_LINE": 11,
        "FIRST_LINE_SAMPLE": 21,
    }  # fmt: skip
    facts = facts_of_keywords(label)
    assert facts["sources"] == {
        "camera": "INSTRUMENT_HOST_NAME and INSTRUMENT_ID",
        "target": "TARGET_LIST",
        "time": "START_TIME and STOP_TIME",
        "exposure_s": "EXPOSURE_DURATION",
        "filter": "FILTER_NAME",
        "gain": "GAIN_MODE_ID",
        "mode": "SUMMING_MODE and FIRST_LINE and FIRST_LINE_SAMPLE",
    }
    assert (facts["stated"].summing, facts["stated"].first) == (2, (20, 10))
    assert (facts["targets"], facts["filter"]) == (("tethys",), "CL1/IR3")


BOTH = "INSTRUMENT_MODE_ID='SUM2' SUMMING_MODE={}"


@pytest.mark.parametrize(("size", "other", "summing"), [((512, 512), 1, 2), ((1024, 1024), 1, 1), ((256, 256), 4, 4)])
def test_of_summings_that_contradict_each_other_the_frames_size_decides(
    size: tuple[int, int], other: int, summing: int, tmp_path: Path
) -> None:
    pixels = picture(*size)
    vicar_file(tmp_path / "a.img", pixels, f"{ISS} {BOTH.format(other)}")
    frame = read_frame(tmp_path / "a.img")
    assert frame.mode.summing == summing
    assert any("summing" in warning and "it is taken as" in warning for warning in frame.warnings)


def test_summings_that_contradict_each_other_in_a_window_are_named(tmp_path: Path) -> None:
    label = f"{ISS} {BOTH.format(1)} FIRST_LINE=101 FIRST_LINE_SAMPLE=51"
    vicar_file(tmp_path / "a.img", picture(90, 80), label)
    with pytest.raises(
        RefusedError, match=r"2x2 summing by INSTRUMENT_MODE_ID.*1x1 summing by SUMMING_MODE.*--summing"
    ):
        read_frame(tmp_path / "a.img")
    frame = read_frame(tmp_path / "a.img", mode=ImageMode(2, (50, 100, 160, 180), "--summing"))
    assert frame.mode.summing == 2


@pytest.mark.parametrize("label", ["SUMMING_MODE=2", "INSTRUMENT_MODE_ID='SUM2' SUMMING_MODE=2 BINNING=2"])
def test_summings_that_agree_are_no_contradiction(label: str, tmp_path: Path) -> None:
    vicar_file(tmp_path / "a.img", picture(512, 512), f"{ISS} {label}")
    frame = read_frame(tmp_path / "a.img")
    assert (frame.mode.summing, frame.warnings) == (2, ())


@pytest.mark.parametrize(("lines", "camera"), [(244, "near-msi-raw"), (412, "near-msi")])
def test_of_cameras_of_one_name_the_frames_size_chooses(lines: int, camera: str, tmp_path: Path) -> None:
    label = "INSTRUMENT_HOST_NAME='NEAR EARTH ASTEROID RENDEZVOUS' INSTRUMENT_ID='MSI' TARGET_NAME='EROS'"
    vicar_file(tmp_path / "a.img", picture(lines, 537), label)
    assert read_frame(tmp_path / "a.img").camera == camera


def test_nears_oblong_pixels_look_where_the_archives_square_ones_look() -> None:
    square, oblong = find_camera("near-msi"), find_camera("near-msi-raw")
    places = RNG.uniform(-0.5, [536.5, 411.5], (60, 2))
    on_ccd = np.column_stack([places[:, 0], (places[:, 1] + 0.5) * 244 / 412 - 0.5])
    apart = square.detector_ray(places) - oblong.detector_ray(on_ccd)
    assert np.abs(apart).max() * square.focal_length_px < 1e-9
