"""Voyager 2's J ring frame C2069302 holds a field of stars: the first truth of its pointing that needs no disk."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import planetpose
from catalog.rotation import vector_deg_from_rotation
from catalog.stars.table import unit_vectors
from flows.cli import build_app
from tasks.stars.image import StarImage, StarRequest, stars_of_image
from tasks.stars.report import in_json

pytestmark = pytest.mark.real
BORESIGHT = unit_vectors(325.51, -12.21)


@pytest.fixture(scope="module")
def voyager(data_folder: Path) -> Path:
    return data_folder / "images/voyager"


@pytest.fixture(scope="module")
def geomed(voyager: Path) -> StarImage:
    return stars_of_image(StarRequest(voyager / "C2069302_GEOMED.IMG"))


@pytest.fixture(scope="module")
def raw(voyager: Path) -> StarImage:
    return stars_of_image(StarRequest(voyager / "C2069302_RAW.IMG", near="325,-12"))


def test_the_corrected_frame_is_identified_without_hints(geomed: StarImage) -> None:
    found = in_json(geomed)
    assert found["region"] == "blind"
    assert found["stars"] >= 12
    assert found["rms_px"] <= 0.42
    assert found["false_alarm_probability"] < 1e-12
    assert np.degrees(np.arccos(np.array(found["camera_from_j2000"])[2] @ BORESIGHT)) < 0.01


def test_the_raw_frame_through_our_own_undistortion_shows_the_same_stars(geomed: StarImage, raw: StarImage) -> None:
    found, other = in_json(raw), in_json(geomed)
    assert found["stars"] >= 12
    assert found["rms_px"] <= 0.40
    used = {each["star"] for each in found["matches"] if each["used"]}
    assert len(used & {each["star"] for each in other["matches"]}) >= 12
    turned = np.array(found["camera_from_j2000"]) @ np.array(other["camera_from_j2000"]).T
    assert np.radians(np.hypot(*vector_deg_from_rotation(turned)[:2])) * geomed.camera.focal_length_px < 0.3


def test_the_stars_confirm_the_scale_of_the_object_space(raw: StarImage) -> None:
    """ISIS has a pixel pitch 1.06 % smaller for this camera."""
    factor = in_json(raw)["focal_length_factor"]
    assert abs(factor["value"] - 1) < 2e-3
    assert factor["sigma"] < 1e-3


def test_python_gives_what_the_command_does(voyager: Path, geomed: StarImage) -> None:
    found = planetpose.stars(voyager / "C2069302_GEOMED.IMG", near="325,-12", kernels=[])
    known = in_json(geomed)
    assert found["camera_from_j2000"] == pytest.approx(np.array(known["camera_from_j2000"]), abs=1e-7)
    assert found["region"] == "cone"


def test_kernels_add_aberration_and_jupiters_cone(voyager: Path, data_folder: Path, geomed: StarImage) -> None:
    request = StarRequest(voyager / "C2069302_GEOMED.IMG", kernels=(data_folder / "kernels",))
    found, without = in_json(stars_of_image(request)), in_json(geomed)
    assert found["region"] == "cone"
    assert found["aberration"]
    assert not without["aberration"]
    # The spacecraft's velocity across the line of sight shifts all stars by about as many arcseconds as km/s.
    apart = np.arccos(np.array(found["camera_from_j2000"])[2] @ np.array(without["camera_from_j2000"])[2])
    assert 5 < np.degrees(apart) * 3600 < 25


def test_a_wrong_cone_finds_nothing(voyager: Path) -> None:
    found = in_json(stars_of_image(StarRequest(voyager / "C2069302_GEOMED.IMG", near="120,40", cone_deg=10.0)))
    assert found["stars"] == 0
    assert found["camera_from_j2000"] is None
    assert found["reason"].startswith("stars-not-identified: ")


def test_the_command_writes_json_and_a_picture_and_goes_on_after_a_refusal(
    voyager: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    arguments = ["stars", "none.img", str(voyager / "C2069302_RAW.IMG"), "--near", "325,-12", "--no-kernels"]
    done = CliRunner().invoke(build_app(), [*arguments, "--json", "--out", str(tmp_path / "out")])
    assert done.exit_code == 1
    refused, found = map(json.loads, capfd.readouterr().out.splitlines())
    assert refused["reason"].startswith("image-missing: ")
    assert found["stars"] >= 12
    assert found["region"] == "cone"
    assert json.loads((tmp_path / "out/C2069302_RAW.json").read_text())["stars"] == found["stars"]
    assert (tmp_path / "out/C2069302_RAW.png").stat().st_size > 50_000
