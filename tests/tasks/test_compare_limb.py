"""Edges along limb segments, and the fit of offset and growth to their shifts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erf

from catalog.errors import FailedError
from lab.simulate.small_world import observation_of, scene_of, small_camera, true_pose
from tasks.compare.limb_edges import LimbEdges, LimbSettings, edge_position, lit_limit_deg, measure_limb
from tasks.compare.limb_errors import EDGE_PX, coherent_px, most_coherent_px
from tasks.compare.limb_fit import fit_limb
from tasks.compare.match import match_scene
from tasks.compare.segments import Segments, profiles

SETTINGS = LimbSettings()
STEPS = np.arange(-8, 9)
CENTRE_PX, RADIUS_PX = np.array([210.4, 95.7]), 60.0


def segments_around(angles_deg: np.ndarray) -> Segments:
    """Segments on a circle about CENTRE_PX."""
    angle = np.radians(angles_deg)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    xy = CENTRE_PX + RADIUS_PX * normal
    horizontal = np.abs(normal[:, 0]) >= np.abs(normal[:, 1])
    crossing, line = np.where(horizontal, xy[:, 0], xy[:, 1]), np.where(horizontal, xy[:, 1], xy[:, 0])
    return Segments(horizontal, np.rint(line).astype(np.int64), crossing, normal, np.zeros(len(angle)))


@settings(max_examples=60, deadline=None)
@given(st.floats(-5, 5), st.sampled_from([-1, 1]), st.floats(0.7, 2.0))
def test_the_edge_of_a_blurred_step_is_found_to_a_hundredth_of_a_pixel(edge: float, outward: int, blur: float) -> None:
    segment = segments_around(np.array([0.0 if outward > 0 else 180.0]))
    values = 100 * (1 - erf(outward * (STEPS - edge) / blur / np.sqrt(2)))[None]
    assert edge_position(values, segment, SETTINGS) == pytest.approx(edge, abs=0.05)


def test_an_edge_that_brightens_outward_or_lies_beyond_the_segment_is_not_found() -> None:
    segment = segments_around(np.array([0.0]))
    rising = 100 * (1 + erf(STEPS / 1.2))[None]
    falling_later = 100 * (1 - erf((STEPS - 12) / 1.2))[None]
    for values in (rising, falling_later, np.full((1, 17), 5.0)):
        assert np.isnan(edge_position(values, segment, SETTINGS)).all()


def test_profiles_are_cut_along_rows_and_columns_and_end_at_the_frame() -> None:
    image = np.arange(300.0).reshape(15, 20)
    segments = Segments(
        np.array([True, False, True]),
        np.array([4, 7, 4]),
        np.array([9.6, 5.2, 18.0]),
        np.array([[1.0, 0], [0, 1], [1, 0]]),
        np.zeros(3),
    )
    cut = profiles(image, segments, (0, 0), 2)
    np.testing.assert_array_equal(cut[0], image[4, 8:13])
    np.testing.assert_array_equal(cut[1], image[3:8, 7])
    np.testing.assert_array_equal(cut[2], [*image[4, 16:20], np.nan])
    np.testing.assert_array_equal(profiles(image[2:, 3:], segments, (3, 2), 2)[0], image[4, 8:13])


def test_the_lit_side_counts_at_low_phase_and_the_incidence_at_high() -> None:
    assert lit_limit_deg(90.0, SETTINGS) == pytest.approx(80)
    assert lit_limit_deg(10.0, SETTINGS) == pytest.approx(90 - np.degrees(np.arcsin(0.6 * np.sin(np.radians(10)))))
    assert lit_limit_deg(0.0, SETTINGS) == 89.5
    assert lit_limit_deg(10.0, SETTINGS, radius_px=100) == lit_limit_deg(10.0, SETTINGS)  # a dark rim of 1.5 px
    assert lit_limit_deg(3.0, SETTINGS, radius_px=100) == 180  # of 0.14 px


@pytest.mark.parametrize(("phase_deg", "is_measured"), [(5.0, True), (12.0, False)])
def test_a_nearly_full_disk_whose_lit_limb_is_outside_is_measured_by_the_rest(
    phase_deg: float, is_measured: bool
) -> None:
    """The terminator is 0.3 px inside the limb of 80 px radius at 5 deg of phase, 1.7 px at 12 deg."""
    camera = small_camera()
    scene, pose = scene_of(camera), true_pose(camera, (112.0, 205.0), phase_deg=phase_deg, sun_azimuth_deg=90.0)
    edges = measure_limb(match_scene(observation_of(scene, pose), scene, pose), SETTINGS)
    assert (len(edges.shift_px) > 100) is is_measured
    if is_measured:
        assert np.abs(edges.shift_px).mean() < 0.15


def edges_with(offset: tuple[float, float], growth: float, noise: float = 0.0, arc_deg: float = 180.0) -> LimbEdges:
    segments = segments_around(np.linspace(-60, arc_deg - 60, 160))
    across = segments.normal @ np.array(offset) + RADIUS_PX * growth
    across += noise * np.random.default_rng(0).standard_normal(len(across))
    along = np.where(segments.horizontal, segments.normal[:, 0], segments.normal[:, 1])
    return LimbEdges(segments, across / along, len(segments), np.zeros((1, 1)))


@settings(max_examples=60, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-0.02, 0.02))
def test_offset_and_growth_are_solved_together(dx: float, dy: float, growth: float) -> None:
    fit = fit_limb(edges_with((dx, dy), growth), CENTRE_PX, True, 16)
    assert fit.offset_px == pytest.approx((dx, dy), abs=0.02)  # segments sit on whole lines, next to the circle
    assert fit.growth == pytest.approx(growth, abs=2e-4)


def test_with_the_growth_held_only_the_offset_is_solved() -> None:
    fit = fit_limb(edges_with((0.7, -0.3), 0.0), CENTRE_PX, False, 16)
    assert fit.offset_px == pytest.approx((0.7, -0.3), abs=1e-9)
    assert fit.growth == 0
    assert not fit.covariance[2].any()
    assert not fit.covariance[:, 2].any()


def test_outliers_on_the_limb_hardly_matter() -> None:
    edges = edges_with((0.4, 0.9), 0.003, noise=0.03)
    edges.shift_px[10:22] += 4.0
    fit = fit_limb(edges, CENTRE_PX, True, 16)
    assert fit.offset_px == pytest.approx((0.4, 0.9), abs=0.05)
    assert fit.growth == pytest.approx(0.003, abs=1e-3)


def test_a_shorter_arc_knows_the_growth_less_well() -> None:
    errors = [
        np.sqrt(fit_limb(edges_with((0, 0), 0, 0.05, arc), CENTRE_PX, True, 16).covariance[2, 2])
        for arc in (180.0, 120.0, 60.0)
    ]
    assert errors[0] < errors[1] < errors[2]


def test_too_few_segments_fail_by_name() -> None:
    with pytest.raises(FailedError) as failure:
        fit_limb(edges_with((0, 0), 0), CENTRE_PX, True, 161)
    assert failure.value.code == "limb-not-measured"


@pytest.mark.parametrize(("arc_px", "least", "most"), [(0.0, 0.0, 0.02), (0.04, 0.0, 0.03), (0.5, 0.35, 0.65)])
def test_arcs_that_lie_off_as_a_whole_are_distinguished_from_segments_that_err_alone(
    arc_px: float, least: float, most: float
) -> None:
    random = np.random.default_rng(4)
    angle_deg = np.arange(0, 300, 0.5)
    noise = 0.1 * random.standard_normal(len(angle_deg))
    arcs = random.choice([-1.0, 1.0], 15)[(angle_deg // 20).astype(int)]
    found = coherent_px(noise + arc_px * arcs, angle_deg)
    assert least <= found <= most
    # At most as much as is seen, noise included; what the edges' own errors may hide is no more than that.
    assert max(0.7 * arc_px, found) <= most_coherent_px(noise + arc_px * arcs, angle_deg) <= max(EDGE_PX, 1.5 * arc_px)


def test_too_few_arcs_tell_nothing_of_the_shape() -> None:
    angle_deg = np.arange(0, 60, 0.5)
    assert coherent_px(np.full(len(angle_deg), 20 * EDGE_PX), angle_deg) == 0
    assert most_coherent_px(np.full(len(angle_deg), 20 * EDGE_PX), angle_deg) == EDGE_PX
