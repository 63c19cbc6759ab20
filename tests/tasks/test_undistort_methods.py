"""Methods fitted to marks: they recover what was planted, and their error figures mean something."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.errors import RefusedError
from catalog.reseau import find_reseau_table, reseau_table_names
from tasks.undistort.mark_set import MarkSet, marks_of_table
from tasks.undistort.methods import BENDING, METHODS, OF_A_FRAME, FittedModel, fit_model
from tasks.undistort.polynomial import monomial_condition_number
from tasks.undistort.radial import radial_rmsd_from_corner
from tasks.undistort.smooth_model import SmoothModel

RAW, OBJECT = (800, 800), (1000, 1000)
SMOOTH = ("polynomial", "thin-plate")
MARKS_ALONE = tuple(method for method in METHODS if method not in OF_A_FRAME)


def planted(noise_px: float, seed: int = 1, hidden: int = 0) -> tuple[MarkSet, Callable[[np.ndarray], np.ndarray]]:
    """Marks of a known distortion of degree 5 with a local bend, their raw places scattered by noise_px; the last
    `hidden` marks are misplaced by 5 px and marked as not found."""
    rng = np.random.default_rng(seed)
    bend = rng.normal(0, 3, (4, 2))

    def truth(raw: np.ndarray) -> np.ndarray:
        u = (raw - 399.5) / 400.0
        r2 = (u**2).sum(axis=-1, keepdims=True)
        powers = np.concatenate([u, u**3, u**5, r2 * u], axis=-1)
        local = np.exp(-r2 / 0.08)
        return 499.5 + 590.0 * u + powers[..., :4] @ bend + 4.0 * r2 * u - 3.0 * r2**2 * u + local * [0.8, -0.6]

    raw = find_reseau_table("vg1_na_sn7").raw_xy
    seen = raw + rng.normal(0, noise_px, raw.shape)
    found = np.arange(len(raw)) < len(raw) - hidden
    seen[~found] += 5.0
    sigma = np.where(found, max(noise_px, 0.05), 2.0)
    return MarkSet(seen, truth(raw), sigma, found, np.zeros(len(raw), bool), RAW, OBJECT), truth


def inner_points(n: int = 400) -> np.ndarray:
    return np.random.default_rng(8).uniform(40, 760, (n, 2))


@pytest.mark.parametrize("method", SMOOTH)
def test_a_smooth_distortion_is_recovered_between_the_marks(method: str) -> None:
    marks, truth = planted(0.1)
    points = inner_points()
    error = np.linalg.norm(fit_model(method, marks).undistort_points(points) - truth(points), axis=1)
    print(f"{method}: median {np.median(error):.3f}, 95 % {np.percentile(error, 95):.3f} px")
    assert np.median(error) < {"polynomial": 0.3, "thin-plate": 0.12}[method]


@pytest.mark.parametrize("method", MARKS_ALONE)
def test_leave_one_out_in_closed_form_equals_leaving_each_mark_out(method: str) -> None:
    marks, _ = planted(0.3, hidden=5)
    report = fit_model(method, marks).report
    for mark in (0, 30, 100, 150):
        refitted = fit_model(method, marks.without(mark))
        by_hand = refitted.undistort_points(marks.raw_xy[mark]) - marks.object_xy[mark]
        assert np.allclose(report.leave_one_out[mark], by_hand, atol=1e-5)


@pytest.mark.parametrize("method", MARKS_ALONE)
def test_residuals_are_predicted_minus_true_places(method: str) -> None:
    marks, _ = planted(0.3)
    model = fit_model(method, marks)
    predicted = model.undistort_points(marks.raw_xy)
    assert np.allclose(model.report.residual, predicted - marks.object_xy, atol=1e-7)
    assert model.report.rmsd_px == pytest.approx(
        np.sqrt(((predicted - marks.object_xy) ** 2).sum(axis=1).mean()), abs=1e-7
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_uncertainty_of_the_thin_plate_is_the_size_of_its_error(seed: int) -> None:
    marks, truth = planted(0.15, seed)
    model = fit_model("thin-plate", marks)
    places = truth(inner_points())
    error = model.undistort_points(inner_points()) - places
    ratio = np.sqrt(np.mean((error / model.uncertainty_px(places)[:, None]) ** 2))
    print(f"error over stated uncertainty: {ratio:.2f}")
    assert 0.4 < ratio < 1.6


def test_uncertainty_grows_where_no_mark_was_found() -> None:
    marks, _ = planted(0.1)
    left = marks.raw_xy[:, 0] < 400
    half = MarkSet(marks.raw_xy, marks.object_xy, np.where(left, 0.1, 2.0), left, ~left & False, RAW, OBJECT)
    model = fit_model("thin-plate", half)
    seen, unseen = model.uncertainty_px([[250.0, 500.0], [750.0, 500.0]])
    assert unseen > 3 * seen
    assert list(model.extrapolated([[250.0, 500.0], [750.0, 500.0]])) == [False, True]


@pytest.mark.parametrize("method", MARKS_ALONE)
def test_marks_that_were_not_found_do_not_pull_the_map(method: str) -> None:
    clean, _ = planted(0.05)
    spoiled, _ = planted(0.05, hidden=10)
    points = clean.object_xy[60:120]
    moved = fit_model(method, clean).distort_points(points) - fit_model(method, spoiled).distort_points(points)
    assert np.abs(moved).max() < (0.6 if method == "radial" else 0.15)


@pytest.fixture(scope="module")
def nominal_models() -> dict[str, FittedModel]:
    marks = marks_of_table(find_reseau_table("vg2_na_sn5"), RAW, OBJECT)
    return {method: fit_model(method, marks) for method in MARKS_ALONE}


@pytest.mark.parametrize("method", SMOOTH)
@settings(deadline=None, max_examples=60)
@given(x=st.floats(-2000, 3000), y=st.floats(-2000, 3000))
def test_smooth_models_round_trip_inside_and_far_outside_the_frame(
    nominal_models: dict[str, FittedModel], method: str, x: float, y: float
) -> None:
    model = nominal_models[method]
    assert np.abs(model.undistort_points(model.distort_points([x, y])) - [x, y]).max() < 1e-6


@settings(deadline=None, max_examples=60)
@given(x=st.floats(30, 970), y=st.floats(30, 970))
def test_the_radial_model_round_trips_inside_the_frame(
    nominal_models: dict[str, FittedModel], x: float, y: float
) -> None:
    model = nominal_models["radial"]
    assert np.abs(model.undistort_points(model.distort_points([x, y])) - [x, y]).max() < 1e-6


@pytest.mark.parametrize("table", reseau_table_names())
def test_nominal_tables_rank_the_methods_as_the_paper_does(table: str) -> None:
    marks = marks_of_table(find_reseau_table(table), RAW, OBJECT)
    reports = {method: fit_model(method, marks).report for method in MARKS_ALONE}
    for method, report in reports.items():
        print(f"{table} {method:10s} " + " ".join(f"{k} {v:.3g}" for k, v in report.summary().items()))
    print(f"{table} radial about pixel (0, 0): {radial_rmsd_from_corner(marks):.1f} px (paper: 17.3)")
    assert reports["radial"].rmsd_px > 3 > 0.8 > reports["polynomial"].rmsd_px
    assert reports["delaunay"].rmsd_px < 1e-9
    assert 15 < radial_rmsd_from_corner(marks) < 23
    best = min(report.leave_one_out_px for report in reports.values())
    assert reports["thin-plate"].leave_one_out_px == best


def test_the_orthogonal_basis_is_well_conditioned_where_the_papers_is_singular() -> None:
    marks = marks_of_table(find_reseau_table("vg1_na_sn7"), RAW, OBJECT)
    assert fit_model("polynomial", marks, 6).report.condition_number < 20
    assert monomial_condition_number(marks, 6) > 1e14


def test_a_purely_radial_distortion_is_recovered_exactly() -> None:
    raw = find_reseau_table("vg1_wa_sn6").raw_xy
    offset = raw - 399.5
    r2 = (offset**2).sum(axis=1, keepdims=True) / 400.0**2
    there = np.ones(len(raw), bool)
    marks = MarkSet(raw, 499.5 + offset * (1.2 + 0.03 * r2 - 0.01 * r2**2), 0.1 * there, there, ~there, RAW, OBJECT)
    assert fit_model("radial", marks, 4).report.rmsd_px < 1e-8


def test_too_high_a_degree_and_unknown_methods_are_refused() -> None:
    marks, _ = planted(0.1)
    few = MarkSet(
        marks.raw_xy[60:80],
        marks.object_xy[60:80],
        marks.sigma_px[60:80],
        marks.found[60:80],
        marks.outside[60:80],
        RAW,
        OBJECT,
    )
    for method in SMOOTH:
        with pytest.raises(RefusedError, match="degree"):
            fit_model(method, few, 6)
    with pytest.raises(RefusedError, match="degree"):
        fit_model("polynomial", marks, 20)
    strip = np.random.default_rng(4).uniform((100, 400), (700, 408), (80, 2))
    there = np.ones(80, bool)
    with pytest.raises(RefusedError, match="condition number"):
        fit_model("polynomial", MarkSet(strip, strip * 1.2, 0.1 * there, there, ~there, RAW, OBJECT), 9)
    with pytest.raises(RefusedError, match="fisheye"):
        fit_model("fisheye", marks)
    with pytest.raises(RefusedError, match="brightness of a frame"):
        fit_model(BENDING, marks)


def test_far_outside_the_frame_the_affine_map_rules() -> None:
    marks, _ = planted(0.1)
    model = fit_model("thin-plate", marks)
    assert isinstance(model, SmoothModel)
    far = model.undistort_points([[5000.0, 400.0], [6000.0, 400.0]])
    assert np.linalg.norm(far[1] - far[0]) / 1000.0 == pytest.approx(590.0 / 400.0, rel=0.02)
