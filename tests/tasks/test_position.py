"""What is at a position: against the projection, there and back, with sigmas, in words, however it is spelled."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent / "products"))

from small_product import EUROPA, camera_of, pose_of, small_publication
from typer.testing import CliRunner

from catalog.errors import WrongOptionError
from catalog.rotation import rotation_from_vector_deg
from flows.cli import build_app
from tasks.joint.parameters import State
from tasks.position.model import PositionModel, read_position_model
from tasks.position.position import FIELDS, positions_of_pixels, positions_of_places
from tasks.position.spelling import read_pixel, read_place
from tasks.project.pixels import project_pixels
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish import publish
from tasks.publish.cube_model import CubeModel

CAMERA = camera_of(160)
SIGMAS = {"offset_px": [0.2, 0.1], "range_factor": 2e-4, "roll_deg": 0.02, "attitude_deg": [0.05, 0.04, 0.03]}


def model_of(pose: Any, uncertainty: PoseUncertainty | None = None) -> PositionModel:
    return PositionModel("made", CubeModel(pose, CAMERA, EUROPA), uncertainty)


@settings(max_examples=40)
@given(
    turn=st.tuples(st.floats(-180, 180), st.floats(-90, 90)),
    moving=st.booleans(),
    xy=st.tuples(st.floats(-40, 200), st.floats(-40, 200)),
)
def test_pixel_to_place_to_pixel_leads_back(turn: tuple[float, float], moving: bool, xy: tuple[float, float]) -> None:
    pose = pose_of(60.0, turn)
    if moving:
        pose = pose.replaced(
            spacecraft_velocity_km_s=np.array([12.0, -20.0, 5.0]), target_velocity_km_s=np.array([-9.0, 14.0, 3.0])
        )
    model = model_of(pose)
    there = positions_of_pixels(model, [xy])[0]
    assert there.visible == (there.latitude_deg is not None)
    if there.latitude_deg is None:
        assert there.lit is None
        assert "off the body" in there.remark
        return
    back = positions_of_places(model, [there.latitude_deg], [there.longitude_deg])[0]
    assert back.visible
    assert back.x_px == pytest.approx(xy[0], abs=1e-6)
    assert back.y_px == pytest.approx(xy[1], abs=1e-6)
    assert back.lit == there.lit == (there.incidence_deg < 90)
    for name in ("incidence_deg", "phase_deg", "range_km"):
        assert getattr(back, name) == pytest.approx(getattr(there, name), rel=1e-9, abs=1e-6), name


def test_places_of_the_far_side_are_behind_the_limb_and_keep_their_angles() -> None:
    model, rng = model_of(pose_of(60.0)), np.random.default_rng(4)
    latitude, longitude = rng.uniform(-90, 90, 200), rng.uniform(0, 360, 200)
    found = positions_of_places(model, latitude, longitude)
    hidden = [each for each in found if not each.visible]
    assert 60 < len(hidden) < 140
    for each in found:
        assert each.visible == (each.emission_deg < 90)
        assert ("behind the limb" in each.remark) == (not each.visible)
        assert ("on the night side" in each.remark) == (each.incidence_deg >= 90) == (not each.lit)
        assert (each.x_px is None) == (not each.visible)


def test_a_place_outside_the_frame_is_said_to_be_there_and_one_behind_the_camera_too() -> None:
    aside = pose_of(60.0).replaced(camera_from_j2000=rotation_from_vector_deg([0.0, 0.3, 0.0]))
    place = positions_of_pixels(model_of(pose_of(60.0)), [[80, 80]])[0]
    away = positions_of_places(model_of(aside), [place.latitude_deg], [place.longitude_deg])[0]
    assert away.visible
    assert away.x_px > 159.5
    assert away.remark == "outside of the frame"
    behind = pose_of(60.0).replaced(camera_from_j2000=np.diag([1.0, -1.0, -1.0]))
    assert positions_of_places(model_of(behind), [10.0], [20.0])[0].remark == "behind the camera"


def test_sigmas_are_the_scatter_of_poses_of_the_stated_covariance() -> None:
    """1500 poses drawn from the covariance; the scatter of so many is known to 1.8 % (1 / sqrt(2 n))."""
    pose, rng = pose_of(60.0), np.random.default_rng(5)
    stated = PoseUncertainty.from_sigmas(SIGMAS)
    draws = rng.multivariate_normal(np.zeros(7), stated.covariance, 1500)
    pixel = positions_of_pixels(model_of(pose, stated), [[70.0, 95.0]])[0]
    place = positions_of_places(model_of(pose, stated), [pixel.latitude_deg], [pixel.longitude_deg])[0]
    seen, where = [], []
    for draw in draws:
        moved = State(pose, 1.0).moved(np.append(draw, 0.0), CAMERA).pose
        planes = project_pixels(moved, CAMERA, EUROPA, np.array([70.0, 95.0]))
        seen.append([float(planes[name]) for name in ("latitude", "longitude", "incidence", "emission", "phase")])
        where.append(CubeModel(moved, CAMERA, EUROPA))
    scatter = np.std(seen, axis=0)
    for name, sigma in zip(FIELDS, scatter, strict=False):
        assert pixel.sigmas[name] == pytest.approx(sigma, rel=0.08), name
    from planetpose import pixel_of

    xy = np.array([pixel_of(model, pixel.latitude_deg, pixel.longitude_deg) for model in where])
    assert place.sigmas["x_px"] == pytest.approx(xy[:, 0].std(), rel=0.08)
    assert place.sigmas["y_px"] == pytest.approx(xy[:, 1].std(), rel=0.08)
    assert place.sigmas["latitude_deg"] is None
    assert pixel.sigmas["x_px"] is None


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("12.5N,271E", (12.5, 271.0)),
        ("12.5n, 89w", (12.5, 271.0)),
        ("-12.5,271", (-12.5, 271.0)),
        ("12.5S 271E", (-12.5, 271.0)),
        ("271E,12.5S", (-12.5, 271.0)),
        (" 0 , -90 ", (0.0, 270.0)),
        ("12.5°N, 360°E", (12.5, 0.0)),
        ("-1e1,+.5", (-10.0, 0.5)),
        ("-12.5 -89", (-12.5, 271.0)),
    ],
)
def test_places_are_read(text: str, place: tuple[float, float]) -> None:
    assert read_place(text) == place


@pytest.mark.parametrize(
    "text", ["", "12", "91,0", "12N,13S", "12E,13E", "12E,13W", "nan,3", "1,2,3", "-12S,4", "north,4", "1e999,4"]
)
def test_what_is_no_place_is_refused_with_how_to_write_one(text: str) -> None:
    with pytest.raises(WrongOptionError, match=r"12\.5N,271E"):
        read_place(text)


def test_pixels_are_read() -> None:
    assert [read_pixel(text) for text in ("219.3,120.7", "-3 5", " 1;.5 ", "1e2,-0")] == [
        (219.3, 120.7), (-3.0, 5.0), (1.0, 0.5), (100.0, 0.0)
    ]  # fmt: skip
    for text in ("", "3", "3,x", "3,4,5", "nan,1"):
        with pytest.raises(WrongOptionError, match="0-based"):
            read_pixel(text)


@pytest.fixture(scope="module")
def product(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return publish(small_publication(), tmp_path_factory.mktemp("store"))


def test_the_command_prints_one_object_per_position(product: Path, capfd: pytest.CaptureFixture[str]) -> None:
    words = ["at", str(product), "80,80", "-3.5,20", "--place", "-6.9,120.67", "--place", "6.9N,300.67E", "--json"]
    done = CliRunner().invoke(build_app(), words)
    assert done.exit_code == 0, done.output
    rows = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert [row["remark"] for row in rows] == [
        "", "outside of the frame, off the body", "", "behind the limb, on the night side",
    ]  # fmt: skip
    wanted = {*FIELDS, "x_px", "y_px", "visible", "lit", "sigmas"}
    assert all(wanted <= set(row) and {*FIELDS, "x_px", "y_px"} == set(row["sigmas"]) for row in rows)
    assert rows[2]["x_px"] == pytest.approx(80, abs=0.1)
    CliRunner().invoke(build_app(), words[:-1])
    people = capfd.readouterr().out
    assert people.count("pixel (") == 3
    assert "behind the limb" in people
    for wrong in (["at", str(product)], ["at", str(product), "--jsn"], ["at", str(product), "--place", "95,3"]):
        assert CliRunner().invoke(build_app(), wrong).exit_code == 2


def test_the_positions_values_are_the_cubes(product: Path) -> None:
    model = read_position_model(product)
    assert model.cube is not None
    ys, xs = np.nonzero(np.isfinite(model.cube.latitude.values))
    chosen = np.random.default_rng(3).integers(0, len(xs), 50)
    for position, x, y in zip(
        positions_of_pixels(model, np.stack([xs, ys], -1)[chosen]), xs[chosen], ys[chosen], strict=True
    ):
        for name, field in zip(("latitude", "longitude", "incidence", "emission", "phase"), FIELDS, strict=False):
            assert getattr(position, field) == pytest.approx(float(model.cube[name][y, x]), abs=4e-5)
        for name in ("latitude", "longitude"):
            stated = float(model.cube[f"{name}_uncertainty"][y, x])
            assert position.sigmas[f"{name}_deg"] == pytest.approx(stated, rel=1e-3)  # stored to ten bits
