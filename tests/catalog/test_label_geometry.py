"""The pose built from a label's scalars gives those scalars back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.flips import PLACES, Flip, flipped, geometry_as_flipped
from catalog.label_geometry import orientation_note, pose_from_label_geometry, unit_vector
from catalog.pose import Pose
from catalog.target import RotationModel, Target

CAMERA = Camera(name="test", size_px=(800, 800), centre_px=(399.0, 399.0), focal_length_px=98455.8)
WIDE = Camera(name="wide", size_px=(1000, 1000), centre_px=(500.0, 480.0), focal_length_px=900.0)
ROTATION = RotationModel(pole_ra_deg=(268.08, -0.009), pole_dec_deg=(64.51, 0.003), prime_meridian_deg=(36.022, 101.37))
BODY = Target(name="body", naif_id=502, radii_km=(1562.6, 1560.3, 1559.5), rotation=ROTATION)
UNMODELLED = Target(name="rock", naif_id=9, radii_km=(10.0, 8.0, 7.0))
ET = 12_000_000.0
GEOMETRY = {
    "distance_km": 1_363_820.0,
    "sub_spacecraft_lat_deg": -1.46131,
    "sub_spacecraft_lon_deg": 213.088,
    "sub_solar_lat_deg": 2.73875,
    "sub_solar_lon_deg": 149.501,
    "north_azimuth_deg": 267.076,
    "centre_x_px": 211.914,
    "centre_y_px": 110.785,
    "solar_distance_km": 745_814_000.0,
}

geometries = st.fixed_dictionaries(
    {
        "distance_km": st.floats(2e3, 1e8),
        "sub_spacecraft_lat_deg": st.floats(-89.5, 89.5),
        "sub_spacecraft_lon_deg": st.floats(0, 360),
        "sub_solar_lat_deg": st.floats(-90, 90),
        "sub_solar_lon_deg": st.floats(0, 360),
        "north_azimuth_deg": st.floats(0, 360),
        "centre_x_px": st.floats(-500, 1500),
        "centre_y_px": st.floats(-500, 1500),
        "solar_distance_km": st.floats(1e7, 1e10),
    }
)


def image_azimuth_deg(pose: Pose, camera: Camera, body_vector_km: np.ndarray) -> float:
    """Clockwise from +x, y down, of the picture of a body-fixed point as seen from the target's centre."""
    centre = camera.project(pose.target_in_camera_km)
    dx, dy = camera.project(pose.target_in_camera_km + pose.camera_from_body @ body_vector_km) - centre
    return float(np.degrees(np.arctan2(dy, dx)) % 360)


def angle_between_deg(first: float, second: float) -> float:
    return abs((first - second + 180) % 360 - 180)


@given(geometries, st.sampled_from([CAMERA, WIDE]), st.floats(-6e8, 6e8))
def test_centre_pole_and_sub_points_come_back(geometry: dict[str, float], camera: Camera, et: float) -> None:
    pose = pose_from_label_geometry(geometry, camera, BODY, et).completed()
    centre = camera.project(pose.target_in_camera_km)
    assert centre == pytest.approx([geometry["centre_x_px"], geometry["centre_y_px"]], abs=1e-5)
    assert pose.range_km == pytest.approx(geometry["distance_km"], rel=1e-12)
    to_spacecraft = pose.spacecraft_in_body_km / pose.range_km
    sub_points = unit_vector(geometry["sub_spacecraft_lat_deg"], geometry["sub_spacecraft_lon_deg"])
    assert to_spacecraft == pytest.approx(sub_points, abs=1e-9)
    sun = unit_vector(geometry["sub_solar_lat_deg"], geometry["sub_solar_lon_deg"])
    assert pose.sun_direction_in_body == pytest.approx(sun, abs=1e-9)
    northward = np.array([0, 0, 0.01 * BODY.radii_km[2]])  # the pole itself may lie behind a camera this near
    assert angle_between_deg(image_azimuth_deg(pose, camera, northward), geometry["north_azimuth_deg"]) < 0.05


@given(geometries)
def test_a_body_without_rotation_model_gets_the_same_picture(geometry: dict[str, float]) -> None:
    with_model = pose_from_label_geometry(geometry, CAMERA, BODY, ET).completed()
    without = pose_from_label_geometry(geometry, CAMERA, UNMODELLED, ET).completed()
    assert without.camera_from_body == pytest.approx(with_model.camera_from_body, abs=1e-9)
    assert np.array_equal(without.body_from_j2000, np.eye(3))
    assert "no rotation model" in (orientation_note(UNMODELLED) or "")
    assert orientation_note(BODY) is None


def test_north_azimuth_counts_clockwise_from_three_oclock() -> None:
    for azimuth, expected in ((0.0, (1, 0)), (90.0, (0, 1)), (270.0, (0, -1))):
        pose = pose_from_label_geometry({**GEOMETRY, "north_azimuth_deg": azimuth}, CAMERA, BODY, ET).completed()
        north = pose.target_in_camera_km + pose.camera_from_body @ np.array([0, 0, 1559.5])
        step = CAMERA.project(north) - CAMERA.project(pose.target_in_camera_km)
        assert step / np.linalg.norm(step) == pytest.approx(expected, abs=1e-6)


def test_east_longitude_grows_to_the_right_when_north_is_up() -> None:
    pose = pose_from_label_geometry({**GEOMETRY, "north_azimuth_deg": 270.0}, CAMERA, BODY, ET).completed()
    east_of_centre = 1560 * unit_vector(0.0, GEOMETRY["sub_spacecraft_lon_deg"] + 20)
    assert angle_between_deg(image_azimuth_deg(pose, CAMERA, east_of_centre), 0.0) < 10


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"distance_km": float("nan")}, "label-geometry-incomplete"),
        ({"distance_km": 100.0}, "label-geometry-impossible"),
        ({"sub_solar_lat_deg": 91.0}, "label-geometry-impossible"),
        ({"solar_distance_km": 0.0}, "label-geometry-impossible"),
        ({"sub_spacecraft_lat_deg": 90.0}, "label-geometry-polar"),
    ],
)
def test_impossible_values_are_refused(change: dict[str, float], code: str) -> None:
    with pytest.raises(RefusedError) as refusal:
        pose_from_label_geometry({**GEOMETRY, **change}, CAMERA, BODY, ET)
    assert refusal.value.code == code
    assert refusal.value.remedy


def test_a_missing_value_is_named() -> None:
    partial = {key: value for key, value in GEOMETRY.items() if key != "north_azimuth_deg"}
    with pytest.raises(RefusedError, match="north_azimuth_deg"):
        pose_from_label_geometry(partial, CAMERA, BODY, ET)


@pytest.mark.parametrize("flip", list(PLACES))
def test_a_labels_scalars_follow_the_picture_that_is_flipped(flip: Flip) -> None:
    """A mark at the centre and one 40 px further towards north: where they are in the flipped picture."""
    ny, nx = 300, 500
    geometry = {**GEOMETRY, "centre_x_px": 320.0, "centre_y_px": 110.0, "north_azimuth_deg": 35.0}
    picture = np.zeros((ny, nx))
    x, y = 320 + 40 * np.cos(np.radians(35)), 110 + 40 * np.sin(np.radians(35))
    picture[110, 320], picture[round(y), round(x)] = 1.0, 2.0
    after = flipped(picture, flip)
    found = geometry_as_flipped(geometry, flip, (ny, nx))
    (centre_y, centre_x), (north_y, north_x) = (np.argwhere(after == mark)[0] for mark in (1.0, 2.0))
    assert (found["centre_x_px"], found["centre_y_px"]) == pytest.approx((centre_x, centre_y))
    azimuth = np.degrees(np.arctan2(north_y - centre_y, north_x - centre_x)) % 360
    assert found["north_azimuth_deg"] == pytest.approx(azimuth, abs=1.5)  # the mark is at a whole pixel
    assert {key: found[key] for key in found if key[:2] != "ce" and key[:2] != "no"} == {
        key: GEOMETRY[key] for key in GEOMETRY if key[:2] != "ce" and key[:2] != "no"
    }
