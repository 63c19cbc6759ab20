"""Planted shifts of the image are what the limb segments report; the true pose leaves next to nothing."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from catalog.observation import Observation
from lab.simulate.small_world import flagged, observation_of, scene_of, small_camera, true_pose
from tasks.compare.segments import limb_segments
from tasks.point.rotation import pose_moved_by
from tasks.project.curves import limb
from tasks.validate import LimbReport, ValidateSettings, validate_limb

RADIUS_PX = 65.0
CAMERA = small_camera(diameter_px=2 * RADIUS_PX, size_px=(184, 176)).model_copy(update={"centre_px": (84.3, 92.6)})
SCENE = scene_of(CAMERA)
# The lit limb spans a half circle from the lower left to the upper right: rows and columns see equal parts of it.
TRUTH = true_pose(CAMERA, sun_azimuth_deg=225.0)


@pytest.fixture(scope="module")
def observation() -> Observation:
    return observation_of(SCENE, TRUTH)


@pytest.fixture(scope="module")
def report(observation: Observation) -> LimbReport:
    return validate_limb(observation, TRUTH, SCENE)


def test_the_true_pose_leaves_next_to_nothing(report: LimbReport) -> None:
    print(f"true pose: rms {report.rms_px:.4f}, mean {np.round(report.mean_px, 4)} px of {report.points} segments")
    assert report.points > 100
    assert report.points == report.tried
    assert report.rms_px < 0.06
    assert report.normal_rms_px <= report.rms_px
    assert np.abs(report.mean_px).max() < 0.02
    assert report.similarity > 0.95
    assert report.correlation > 0.999


@pytest.mark.parametrize("shift_px", [(0.5, 0.0), (0.0, 0.5), (2.0, 0.0), (0.0, -2.0), (-0.5, 0.3), (1.2, 2.0)])
def test_a_planted_shift_is_what_the_segments_report(observation: Observation, shift_px: tuple[float, float]) -> None:
    wrong = pose_moved_by(TRUTH, CAMERA, -np.array(shift_px))
    report = validate_limb(observation, wrong, SCENE)
    # A row crosses a shifted round limb by the shift along it, and by the other part times the limb's slope.
    normal = limb_normals(report)
    along = np.where(report.horizontal, normal[:, 0], normal[:, 1])
    expected = (normal @ np.array(shift_px)) / along
    error = report.shift_px - expected
    curved_px = 0.03 + np.dot(shift_px, shift_px) / 2 / RADIUS_PX  # the limb bends away from its tangent
    rows, columns = report.mean_px
    print(f"shift {shift_px}: mean of rows {rows:.3f}, of columns {columns:.3f}, scatter {error.std():.3f} px")
    assert np.median(error) == pytest.approx(0, abs=curved_px)
    assert error.std() < 0.1
    fitted = np.linalg.lstsq(normal, report.shift_px * along, rcond=None)[0]
    assert fitted == pytest.approx(shift_px, abs=curved_px)
    means = [expected[report.horizontal].mean(), expected[~report.horizontal].mean()]
    assert report.mean_px == pytest.approx(means, abs=curved_px)
    assert report.rms_px == pytest.approx(np.sqrt(np.mean(expected**2)), abs=0.05)


def limb_normals(report: LimbReport) -> np.ndarray:
    """Outward normals of the (nearly round) disk at the segments (n, 2)."""
    centre = CAMERA.project(TRUTH.target_in_camera_km)
    away = report.xy_px - centre
    return away / np.linalg.norm(away, axis=1, keepdims=True)


@pytest.mark.parametrize("growth", [0.01, -0.02])
def test_a_wrong_size_is_reported_across_the_limb(observation: Observation, growth: float) -> None:
    report = validate_limb(observation, TRUTH.with_range_factor(1 + growth), SCENE)
    expected = RADIUS_PX * growth
    print(f"disk {growth:+.0%} too small: {report.normal_median_px:.3f} px outward, expected about {expected:.3f}")
    assert report.normal_median_px == pytest.approx(expected, rel=0.1)


def test_segments_cross_the_limb_less_tangentially_than_the_other_way(report: LimbReport) -> None:
    normal = limb_normals(report)
    assert (np.abs(normal[report.horizontal, 0]) > 0.70).all()
    assert (np.abs(normal[~report.horizontal, 1]) > 0.70).all()
    assert 0.4 < report.horizontal.mean() < 0.6


def test_segments_lie_on_the_analytic_limb_on_whole_rows_or_columns() -> None:
    segments = limb_segments(TRUTH, SCENE)
    curve = limb(TRUTH, CAMERA, SCENE.target, 5000).xy_px
    away = np.linalg.norm(segments.xy_px[:, None] - curve[None], axis=2).min(axis=1)
    assert away.max() < 0.06
    fixed = np.where(segments.horizontal, segments.xy_px[:, 1], segments.xy_px[:, 0])
    np.testing.assert_array_equal(fixed, np.rint(fixed))
    assert len(segments) == pytest.approx(
        4 * RADIUS_PX * np.sqrt(2), rel=0.05
    )  # every row and column once on either side


def test_only_the_lit_side_is_compared(observation: Observation, report: LimbReport) -> None:
    camera_from_body = TRUTH.camera_from_body
    sun = (camera_from_body @ TRUTH.sun_direction_in_body)[:2]
    toward_sun = limb_normals(report) @ (sun / np.linalg.norm(sun))
    assert toward_sun.min() > 0.15
    wider = validate_limb(observation, TRUTH, SCENE, ValidateSettings(max_incidence_deg=89))
    narrower = validate_limb(observation, TRUTH, SCENE, ValidateSettings(max_incidence_deg=60))
    assert narrower.points < report.points < wider.points


def test_unusable_pixels_leave_their_segments_out(observation: Observation, report: LimbReport) -> None:
    lost = np.zeros(observation.image.shape, bool)
    lost[:, :60] = True
    fewer = validate_limb(flagged(observation, lost), TRUTH, SCENE)
    assert 16 <= fewer.points < report.points
    assert (fewer.xy_px[:, 0] >= 60).all()
    assert fewer.rms_px < 0.06
    lost[:, :120] = True
    too_few = validate_limb(flagged(observation, lost), TRUTH, SCENE)
    assert too_few.points < 16
    assert (too_few.rms_px, too_few.mean_px, too_few.normal_rms_px) == (None, None, None)
    assert too_few.figures().points == too_few.points


@pytest.mark.parametrize("more_px", [0.0, 1.0, 2.0, 4.0])
def test_the_limb_shows_how_wide_the_psf_is(observation: Observation, more_px: float) -> None:
    image = gaussian_filter(observation.image.astype(float), more_px).astype(np.float32)
    report = validate_limb(Observation(image, observation.noise, observation.quality), TRUTH, SCENE)
    expected = float(np.hypot(SCENE.psf_sigma_px, more_px))
    print(f"PSF {expected:.2f} px, shown {report.psf_sigma_px:.2f} px")
    assert report.psf_sigma_px == pytest.approx(expected, rel=0.15)
