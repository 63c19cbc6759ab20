"""Distortion models: both directions agree, signs follow their sources, bad input is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.camera import Camera, Distortion, known_cameras
from catalog.errors import RefusedError
from catalog.reseau import find_reseau_table, reseau_table_names
from tasks.undistort import UndistortSettings
from tasks.undistort.choose import chosen_model
from tasks.undistort.delaunay import DelaunayModel
from tasks.undistort.mark_set import MarkSet, marks_of_table
from tasks.undistort.triangles import TriangleMap

RAW, OBJECT = (800, 800), (1000, 1000)
SSI_ALTERNATIVES = {
    "ssi-cubic": {"corner_shift_px": 1.2},
    "ssi-quadratic": {"corner_shift_px": 1.2},
    "radial-k1": {"k1_per_mm2": -2.4976984e-5},
    "lorri-em": {"em": [2.717254e-5, -1.903439e-5, -2.880665e-5], "y_up": False},
}


def camera_with(model: str) -> Camera:
    return known_cameras()["galileo-ssi"].model_copy(
        update={"distortion": Distortion(model=model, **SSI_ALTERNATIVES[model])}
    )


def nominal(name: str) -> DelaunayModel:
    return DelaunayModel(marks_of_table(find_reseau_table(name), RAW, OBJECT))


def marks_at(raw_xy: np.ndarray, object_xy: np.ndarray) -> MarkSet:
    there = np.ones(len(raw_xy), dtype=bool)
    return MarkSet(raw_xy, object_xy, np.full(len(raw_xy), 0.1), there, ~there, RAW, OBJECT)


@pytest.mark.parametrize("model", SSI_ALTERNATIVES)
@settings(deadline=None)
@given(x=st.floats(-100, 900), y=st.floats(-100, 900))
def test_analytic_models_round_trip_to_a_millionth_of_a_pixel(model: str, x: float, y: float) -> None:
    distortion, _ = chosen_model(camera_with(model), UndistortSettings())
    there = distortion.distort_points(distortion.undistort_points([x, y]))
    back = distortion.undistort_points(distortion.distort_points([x, y]))
    assert np.abs(there - [x, y]).max() < 1e-6
    assert np.abs(back - [x, y]).max() < 1e-6


@pytest.mark.parametrize("name", reseau_table_names())
@settings(deadline=None)
@given(x=st.floats(-3000, 4000), y=st.floats(-3000, 4000))
def test_triangulated_models_round_trip_inside_and_far_outside_the_frame(name: str, x: float, y: float) -> None:
    distortion = nominal(name)
    assert np.abs(distortion.undistort_points(distortion.distort_points([x, y])) - [x, y]).max() < 1e-3
    assert np.abs(distortion.distort_points(distortion.undistort_points([x, y])) - [x, y]).max() < 1e-3


def test_ssi_raw_corner_lies_outside_the_undistorted_one() -> None:
    """Pincushion: VICAR's GLLGCOR and ISIS's negative K1 both put the raw point further from the axis."""
    for model in ("ssi-cubic", "radial-k1"):
        distortion, _ = chosen_model(camera_with(model), UndistortSettings())
        raw_offset = distortion.distort_points([799.0, 799.0]) - 399.0
        shift_px = np.hypot(*raw_offset) - np.hypot(400.0, 400.0)
        assert shift_px == pytest.approx({"ssi-cubic": 1.2, "radial-k1": 1.05}[model], abs=0.01)


def test_lorri_coefficients_agree_with_the_sip_keywords_of_its_files() -> None:
    """AP_3_0, AP_1_1 and AP_2_0 of lor_0299140073_0x630_sci.fit are EM2, EM5 and EM6 in pixels, rows upwards."""
    camera = known_cameras()["newhorizons-lorri"]
    distortion, _ = chosen_model(camera, UndistortSettings(method="lorri-em"))
    x, y_up = 300.0, 200.0
    factor = 1 + 4.5900372459772e-9 * (x**2 + y_up**2) - 3.7439988768003e-7 * x - 2.4738992578302e-7 * y_up
    raw = distortion.distort_points([511.5 + x, 511.5 - y_up]) - 511.5
    assert np.allclose(raw, [x * factor, -y_up * factor], rtol=0, atol=1e-4)


@pytest.mark.parametrize("name", reseau_table_names())
def test_delaunay_reproduces_every_mark(name: str) -> None:
    table = find_reseau_table(name)
    distortion = nominal(name)
    assert np.abs(distortion.distort_points(table.object_xy) - table.raw_xy).max() < 1e-9
    assert np.abs(distortion.undistort_points(table.raw_xy) - table.object_xy).max() < 1e-9


def test_delaunay_is_continuous_across_the_hull_and_flags_what_lies_beyond() -> None:
    distortion = nominal("vg1_na_sn7")
    line = np.stack([np.linspace(-200.0, 100.0, 3001), np.full(3001, 431.7)], axis=-1)
    steps = np.abs(np.diff(distortion.distort_points(line), axis=0)).max()
    assert steps < 0.15  # 0.1 px apart, scale about 0.85
    flagged = distortion.extrapolated(line)
    assert flagged[0]
    assert not flagged[-1]
    assert np.count_nonzero(np.diff(flagged)) == 1


def test_a_map_on_triangles_is_exact_for_an_affine_map() -> None:
    rng = np.random.default_rng(3)
    source = rng.uniform(0, 100, (40, 2))
    matrix, shift = np.array([[0.9, 0.1], [-0.2, 1.1]]), np.array([3.0, -7.0])
    triangles = TriangleMap(source, source @ matrix.T + shift)
    inside = source[triangles.corners].mean(axis=1)
    mapped = triangles.forward(inside, triangles.triangle_of(inside))
    assert np.allclose(mapped, inside @ matrix.T + shift, atol=1e-10)
    assert np.array_equal(triangles.triangle_of_target(mapped), triangles.triangle_of(inside))


def test_collinear_too_few_and_swapped_marks_are_refused() -> None:
    table = find_reseau_table("vg1_na_sn7")
    line = np.stack([np.arange(30.0), 2 * np.arange(30.0)], axis=-1)
    with pytest.raises(RefusedError, match="one line"):
        marks_at(line, line)
    with pytest.raises(RefusedError, match="too few"):
        DelaunayModel(marks_at(table.raw_xy[10:15], table.object_xy[10:15]))
    swapped = table.raw_xy.copy()
    swapped[[100, 101]] = swapped[[101, 100]]
    with pytest.raises(RefusedError, match="turn over"):
        DelaunayModel(marks_at(swapped, table.object_xy))


def test_an_unknown_model_and_a_missing_parameter_are_refused_by_name() -> None:
    camera = known_cameras()["cassini-nac"]
    for distortion, word in ((Distortion(model="fisheye"), "fisheye"), (Distortion(model="ssi-cubic"), "corner_shift")):
        with pytest.raises(RefusedError, match=word):
            chosen_model(camera.model_copy(update={"distortion": distortion}), UndistortSettings())


def test_the_published_roll_turns_the_undistorted_frame() -> None:
    camera = known_cameras()["newhorizons-lorri"]
    plain, _ = chosen_model(camera, UndistortSettings(method="lorri-em"))
    turned, evidence = chosen_model(camera, UndistortSettings(method="lorri-em", roll="published"))
    corner = np.array([1023.0, 1023.0])
    moved = turned.undistort_points(plain.distort_points(corner)) - corner
    assert np.hypot(*moved) == pytest.approx(511.5 * np.sqrt(2) * np.radians(0.191), rel=1e-3)  # 2.4 px
    assert moved[0] < 0 < moved[1]
    assert evidence["roll_deg"] == 0.191
    assert np.abs(turned.distort_points(turned.undistort_points(corner)) - corner).max() < 1e-9
    with pytest.raises(RefusedError, match="published_roll_deg"):
        chosen_model(known_cameras()["cassini-nac"], UndistortSettings(roll="published"))
