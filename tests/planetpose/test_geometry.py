"""The public functions between pixels and places, on random bodies and poses, and against each other."""

from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import RotationModel, Target
from planetpose import CubeModel, RefusedError, backplanes, pixel_of, place_of
from tasks.publish.cube_model import Detector

CAMERA = Camera(name="test", size_px=(90, 70), centre_px=(43.2, 36.9), focal_length_px=20000.0)
SPIN = RotationModel(pole_ra_deg=(0,), pole_dec_deg=(90,), prime_meridian_deg=(0, 870.5))


@st.composite
def models(draw: st.DrawFn) -> CubeModel:
    """A triaxial body some thirty pixels in radius, anywhere near the frame, seen at rest or in motion."""
    a = draw(st.floats(50, 70000))
    radii = (a, a * draw(st.floats(0.8, 1)), a * draw(st.floats(0.7, 1)))
    target = Target(name="body", naif_id=9, radii_km=radii, rotation=SPIN)
    turn, look = (draw(st.tuples(*[st.floats(-90, 90)] * 3)) for _ in range(2))
    camera_from_j2000 = rotation_from_vector_deg(look)
    aside = draw(st.tuples(st.floats(-20, 20), st.floats(-20, 20)))
    centre = camera_from_j2000.T @ CAMERA.ray(np.add(CAMERA.centre_px, aside)) * a * 20000 / 30
    pose = Pose(0.0, camera_from_j2000, centre, np.array([-7e8, 2e8, -1e8]), rotation_from_vector_deg(turn))
    if draw(st.booleans()):
        velocity = st.tuples(*[st.floats(-40, 40)] * 3)
        pose = pose.replaced(spacecraft_velocity_km_s=draw(velocity), target_velocity_km_s=draw(velocity))
    return CubeModel(pose, CAMERA, target)


@settings(max_examples=40)
@given(models(), st.randoms(use_true_random=False))
def test_what_a_pixel_sees_is_seen_by_that_pixel(model: CubeModel, random: Any) -> None:
    x, y = (np.array([random.uniform(-0.5, size - 0.5) for _ in range(60)]) for size in CAMERA.size_px)
    latitude, longitude = place_of(model, x, y)
    seen = np.isfinite(latitude)
    assert (seen == np.isfinite(longitude)).all()
    back = np.stack(pixel_of(model, latitude, longitude))
    assert (np.isnan(back) == ~seen).all()
    # near the limb a pixel's place is known by the square root of rounding
    assert np.nanmax(np.abs(back - [x, y]), initial=0.0) < 1e-6


@settings(max_examples=40)
@given(models())
def test_places_are_seen_or_hidden_as_the_backplanes_have_them(model: CubeModel) -> None:
    planes = backplanes(model.pose, model.camera, model.target, planes=("latitude", "longitude", "emission"))
    xs, ys = np.meshgrid(planes.x, planes.y)
    latitude, longitude = place_of(model, xs, ys)
    np.testing.assert_allclose(latitude, planes.latitude, atol=1e-9)
    off = np.abs(longitude - planes.longitude.values) * np.cos(np.radians(latitude))
    assert np.nanmax(np.minimum(off, 360 - off), initial=0.0) < 1e-8
    # the same place on the far side of the body is hidden
    x, y = pixel_of(model, -latitude, longitude + 180)
    well_inside = planes.emission.values < 80
    assert np.isnan(x[well_inside]).all()
    assert np.isnan(y[well_inside]).all()


def model_of_a_moon(**changes: Any) -> CubeModel:
    target = Target(name="moon", naif_id=9, radii_km=(1500, 1490, 1480))
    pose = Pose(0.0, np.eye(3), np.array([0, 0, 1e6]), np.array([-7e8, 2e8, -1e8]), rotation_from_vector_deg([9, 8, 7]))
    return CubeModel(pose.replaced(**changes), CAMERA, target)


def test_shapes_follow_numpys_broadcasting_and_what_is_unknown_stays_so() -> None:
    model = model_of_a_moon()
    latitude, longitude = place_of(model, 43.0, 37.0)
    assert latitude.shape == longitude.shape == ()
    x, y = pixel_of(model, np.linspace(-100, 100, 5)[:, None], np.array([float(longitude), np.nan, 720.0 + longitude]))
    assert x.shape == y.shape == (5, 3)
    assert np.isnan(x[:, 1]).all()  # no longitude
    assert np.isnan(x[[0, 4]]).all()  # no latitude
    np.testing.assert_allclose(x[2, 0], x[2, 2])
    assert np.isnan(place_of(model, [np.nan, 1e6], [3.0, 3.0])).all()


def test_a_target_behind_the_camera_is_seen_by_no_pixel() -> None:
    model = model_of_a_moon(camera_from_j2000=np.diag([1.0, -1.0, -1.0]))
    latitudes = np.linspace(-90, 90, 19)
    assert np.isnan(pixel_of(model, latitudes[:, None], np.arange(0, 360, 20))).all()


def test_a_place_outside_the_frame_has_its_pixel_there() -> None:
    away = CAMERA.ray([200.0, 36.0]) * 1e6
    model = model_of_a_moon(target_from_spacecraft_km=away)
    x, y = pixel_of(model, *place_of(model, 201.25, 36.5))
    np.testing.assert_allclose([x, y], [201.25, 36.5], atol=1e-8)


def test_backplanes_of_a_window_are_part_of_those_of_the_frame() -> None:
    model = model_of_a_moon()
    whole = backplanes(model.pose, model.camera, model.target)
    part = backplanes(model.pose, model.camera, model.target, window=(30, 20, 50, 40), planes=("phase", "x_km"))
    assert set(part.data_vars) == {"phase", "x_km"}
    xr.testing.assert_allclose(part.phase, whole.phase.sel(x=part.x, y=part.y))
    assert (whole.phase.attrs["units"], part.x_km.attrs["units"]) == ("degree", "km")
    with pytest.raises(ValueError, match="unknown planes"):
        backplanes(model.pose, model.camera, model.target, planes=("lattitude",))
    inside = model.pose.replaced(target_from_spacecraft_km=np.array([0, 0, 100.0]))
    with pytest.raises(RefusedError, match="inside the body"):
        backplanes(inside, model.camera, model.target)


def test_what_is_no_cube_is_refused() -> None:
    with pytest.raises(RefusedError, match="no cube of an image"):
        pixel_of(xr.Dataset(), 0.0, 0.0)


def test_a_raw_frame_with_a_gap_has_no_pixel_there() -> None:
    ys, xs = np.mgrid[:30, :40].astype(float)
    places = np.stack([1.25 * xs + 0.02 * ys + 3 + 1e-3 * xs**2, 1.2 * ys - 0.01 * xs - 2], axis=-1)
    whole, holed = Detector(places, (0.0, 0.0)), Detector(places.copy(), (0.0, 0.0))
    holed.places[10:15, 10:20] = np.nan
    xy = np.random.default_rng(2).uniform([0, 0], [39, 29], (300, 2))
    np.testing.assert_allclose(whole.pixels_of(whole.undistorted_of(xy)), xy, atol=1e-5)
    assert np.isnan(whole.pixels_of(np.array([[1000.0, 10.0], [np.nan, 3.0]]))).all()
    found = holed.pixels_of(whole.undistorted_of(xy))
    in_gap = ((xy > [10, 10]) & (xy < [19, 14])).all(axis=1)
    assert in_gap.any()
    assert np.isnan(found[in_gap]).all()
    away = ((xy < [8, 8]) | (xy > [21, 16])).any(axis=1)
    np.testing.assert_allclose(found[away], xy[away], atol=1e-5)
