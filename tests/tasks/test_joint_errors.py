"""What the joint estimator adds to its errors, and what it finds at reduced resolution."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from catalog.target import find_target
from lab.simulate.plant import planted, pose_error
from lab.simulate.small_world import observation_of, scene_of, small_camera, true_pose
from tasks.attitude.markings import Markings
from tasks.attitude.texture import texture_of
from tasks.joint import JointSettings, find_pose_jointly
from tasks.joint.coarse_to_fine import estimated, prior_sigmas
from tasks.joint.orientation import with_least_error
from tasks.joint.parameters import ATTITUDE, OFFSET, PSF, RANGE, ROLL, State
from tasks.joint.problem import DistortionError, Problem
from tasks.joint.pyramid import Level, width_in_frame_px
from tasks.joint.tile_prior import limb_gain
from tasks.joint.uncertainty import of_the_body, systematic, times_usual

ONCE = JointSettings(second_start=False)
LIMITS = ONCE.thresholds.orientation


def test_radius_and_relief_of_the_body_are_errors_of_range_and_centre() -> None:
    europa, pluto = find_target("europa"), find_target("pluto")
    variance = np.diag(of_the_body(europa, 100.0))
    assert np.sqrt(variance[RANGE]) == pytest.approx(np.hypot(0.3 / 1560.8, 0.32 / 1560.8 / 3), rel=0.01)
    assert np.sqrt(variance[OFFSET]) == pytest.approx(np.sqrt(2 / 9) * 0.0205, rel=0.01)
    assert not variance[RANGE + 1 :].any()
    assert np.sqrt(of_the_body(pluto, 400.0)[RANGE, RANGE]) == pytest.approx(1.6 / 1188.3)
    unknown = europa.model_copy(update={"radius_sigma_km": None, "relief_km": None})
    assert not of_the_body(unknown, 100.0).any()


def test_relief_is_what_the_body_is_known_for_or_what_its_limb_shows_if_that_is_more() -> None:
    europa = find_target("europa").model_copy(update={"radius_sigma_km": 0.0})
    response = np.zeros((8, 18))
    response[0, 3], response[RANGE, 3] = 0.3, -0.002
    reported, same, more = (of_the_body(europa, 100.0, response, shown_px) for shown_px in (0.0, 0.01, 0.4))
    relief_px = 0.32 / 1560.8 * 100
    assert np.sqrt(reported[0, 0]) == pytest.approx(0.3 * relief_px, rel=0.01)
    assert reported[0, RANGE] == pytest.approx(-0.3 * 0.002 * relief_px**2, rel=0.02)
    assert np.array_equal(same, reported)
    assert np.sqrt(more[0, 0]) == pytest.approx(0.3 * 0.4)


@pytest.mark.parametrize(
    ("radius_px", "centre_px", "n"),
    [(110.0, (256, 256), 1), (250.0, (256, 256), 1), (700.0, (256, 256), 1), (500.0, (600, 256), 1)],
)
def test_disks_cut_by_the_frame_are_solved_by_what_is_in_it(
    radius_px: float, centre_px: tuple[float, float], n: int
) -> None:
    camera = small_camera(2 * radius_px, (512, 512)).model_copy(update={"centre_px": (255.5, 255.5)})
    scene, pose = scene_of(camera), true_pose(camera, centre_px)
    width = width_in_frame_px(scene, pose)
    assert max(1, round(width / JointSettings().diameter_px)) == n
    assert width <= 2 * radius_px * 1.01
    assert width <= 512 * 1.01


def test_an_orientation_from_a_file_leaves_the_kernels_range_as_sure_as_it_is() -> None:
    priors = ONCE.priors
    sources = {"camera_from_j2000": "file", "target_from_spacecraft_km": "spice", "body_from_j2000": "catalog"}
    chosen = priors.of(sources)
    assert (chosen.range_km, chosen.range_share) == (priors.spice.range_km, None)
    assert chosen.range_sigma(1e5) == pytest.approx(2e-4)
    assert priors.file.range_sigma(1e5) == pytest.approx(0.02)
    assert chosen.attitude_deg == priors.spice.attitude_deg < priors.file.attitude_deg
    assert chosen.roll_deg == priors.file.roll_deg
    assert priors.of(dict.fromkeys(sources, "label")) == priors.label


def test_a_disk_solved_at_half_the_resolution_is_found_and_reported_in_the_image_s_pixels() -> None:
    camera = small_camera(120.0, (176, 176)).model_copy(update={"centre_px": (87.5, 87.5)})
    scene, truth = scene_of(camera), true_pose(camera)
    start = planted(truth, camera, (0.9, -0.7), 1.004, (0.2, -0.2, 0.2))
    seen = observation_of(scene, truth)
    half = ONCE.model_copy(update={"diameter_px": 60.0, "first_diameter_px": 60.0})
    whole = find_pose_jointly(seen, start, start, "file", scene, ONCE)
    found = find_pose_jointly(seen, start, start, "file", scene, half)
    error = pose_error(found.pose, truth, camera, scene.target)
    print(f"half resolution: {error}; whole: {pose_error(whole.pose, truth, camera, scene.target)}")
    assert np.hypot(*error.centre_px) < 0.06
    assert abs(error.range) < 1.5e-3
    assert found.changed["psf_sigma_px"] == pytest.approx(whole.changed["psf_sigma_px"], rel=0.1)
    # Half of the resolution loses little: the disk is blurred over two pixels.
    ratio = np.array(found.uncertainty["offset_px"]) / whole.uncertainty["offset_px"]
    assert ((ratio > 0.8) & (ratio < 1.6)).all(), ratio


def test_an_error_of_the_bending_common_to_all_pixels_is_an_error_of_the_centre() -> None:
    camera = small_camera(90.0, (124, 124)).model_copy(update={"centre_px": (61.5, 61.5)})
    scene, truth = scene_of(camera), true_pose(camera)
    seen = observation_of(scene, truth)
    planes = np.zeros((2, 124, 124), np.float16)
    planes[1] = 0.3
    exact, bent = (
        find_pose_jointly(seen, truth, truth, "file", scene, ONCE, distortion=DistortionError(0.0, bending))
        for bending in (None, planes)
    )
    assert bent.changed["offset_px"] == pytest.approx(exact.changed["offset_px"], abs=0.01)
    added = np.sqrt(np.square(bent.uncertainty["offset_px"]) - np.square(exact.uncertainty["offset_px"]))
    assert added[1] == pytest.approx(0.3, abs=0.03)
    assert added[0] < 0.06


def test_the_systematic_part_grows_with_the_blur_and_with_what_the_map_gets_wrong_of_the_limb() -> None:
    usual = ONCE.systematic
    assert times_usual(usual, 0.8, 0.5 * usual.limb_gain) == (1, 1)
    assert times_usual(usual, 3.0, 4 * usual.limb_gain) == pytest.approx((12, 6))
    shared = usual.model_copy(update={"local_px": 0.0})
    once, thrice = (np.diag(systematic(shared, 80.0, larger=k)) for k in ((1.0, 1.0), (3.0, 2.0)))
    assert np.sqrt(thrice[: RANGE + 1] / once[: RANGE + 1]) == pytest.approx([3, 3, 2])
    assert np.array_equal(thrice[RANGE + 1 :], once[RANGE + 1 :])


def test_what_errs_apart_along_the_limb_averages_out_on_large_disks() -> None:
    usual = ONCE.systematic
    shared = usual.model_copy(update={"local_px": 0.0})
    for radius_px in (10.0, 160.0):
        added = np.diag(systematic(usual, radius_px) - systematic(shared, radius_px))
        averaged_px = usual.local_px / np.sqrt(radius_px)
        assert added[: RANGE + 1] == pytest.approx(
            [averaged_px**2, averaged_px**2, (averaged_px / radius_px) ** 2], rel=1e-9
        )
        assert not added[RANGE + 1 :].any()


@pytest.mark.parametrize(("noise", "least", "most"), [(0.0, 0.0, 0.02), (0.2, 0.07, 0.3)])
def test_what_a_map_gets_wrong_of_the_limbs_brightness_is_seen(noise: float, least: float, most: float) -> None:
    camera = small_camera(90.0, (124, 124)).model_copy(update={"centre_px": (61.5, 61.5)})
    scene, truth = scene_of(camera, photometry="mixture"), true_pose(camera, phase_deg=50.0)
    grain = cv2.GaussianBlur(np.random.default_rng(5).normal(size=scene.basemap.albedo.shape), (0, 0), 40.0)
    wrong = scene.basemap.albedo * np.clip(1 + noise * grain / grain.std(), 0.2, None)
    seen = observation_of(replace(scene, basemap=replace(scene.basemap, albedo=wrong.astype(np.float32))), truth)
    start = State(truth, camera.psf_sigma_px)
    found = estimated(Problem(seen, scene, start, prior_sigmas(ONCE.priors.file, truth.range_km), ONCE), start).free
    gain = limb_gain(found.fit, found.variances.tiles, found.model.tiles.sectors, ONCE.tiles)
    print(f"\nnoise of the map {noise}: gains along the limb {gain:.4f}")
    assert least <= gain <= most


@pytest.mark.parametrize(("correlation", "independent"), [(0.9999, 2000.0), (0.75, 280.0), (0.95, 30.0)])
def test_a_turn_about_the_line_of_sight_is_known_better_than_one_across(correlation: float, independent: float) -> None:
    camera = small_camera(60.0, (90, 90)).model_copy(update={"centre_px": (44.5, 44.5)})
    scene, truth = scene_of(camera, photometry="mixture"), true_pose(camera, phase_deg=40.0)
    seen = observation_of(scene, truth)
    texture = texture_of(seen, truth, scene)
    start = State(truth, camera.psf_sigma_px)
    estimate = estimated(Problem(seen, scene, start, prior_sigmas(ONCE.priors.file, truth.range_km), ONCE), start)
    assert texture is not None
    markings = Markings("matched", correlation=correlation, independent=independent)
    added = with_least_error(estimate, texture, markings, np.zeros(3), LIMITS).covariance - estimate.covariance
    pose = estimate.state.pose
    sight = pose.camera_from_body.T @ pose.target_in_camera_km / pose.range_km
    across = np.cross(sight, [0.3, -0.5, 0.8])
    across /= np.linalg.norm(across)
    turns = added[ATTITUDE, ATTITUDE]
    pixel_deg = np.degrees(1 / 30)  # the disk's radius is 30 px
    peak_px = LIMITS.peak_px * np.sqrt((1 - correlation**2) / independent) / correlation
    across_px = np.hypot(LIMITS.across_px, peak_px)
    about_px = across_px * LIMITS.about_px / LIMITS.across_px
    assert np.sqrt(sight @ turns @ sight) == pytest.approx(about_px * pixel_deg, rel=0.1)
    assert np.sqrt(across @ turns @ across) == pytest.approx(across_px * pixel_deg, rel=0.1)
    assert not added[: ATTITUDE.start].any()


def test_scales_convert_states_and_displacements() -> None:
    camera = small_camera(120.0, (176, 176))
    scene, truth = scene_of(camera), true_pose(camera)
    state = State(truth, 0.9)
    given = Problem(observation_of(scene, truth), scene, state, np.full(PSF + 1, np.inf), ONCE)
    scale = Level.of(given, state, 60.0)
    assert scale.n == 2
    assert scale.up(scale.down(State(truth, 0.9))).psf_sigma_px == pytest.approx(0.9)
    assert scale.planes_down(np.full((2, 176, 176), 0.4, np.float32)) == pytest.approx(np.full((2, 88, 88), 0.2))
    variance = np.diag(scale.covariance_up(np.eye(PSF + 1)))
    assert variance[OFFSET] == pytest.approx([4.0, 4.0])
    assert variance[RANGE] == 1.0


@pytest.mark.parametrize("prior", ["file", "spice"])
def test_the_focal_length_s_error_is_in_the_free_range_before_it_is_weighed_with_the_trajectory_s(prior: str) -> None:
    camera = small_camera(90.0, (124, 124)).model_copy(update={"centre_px": (61.5, 61.5)})
    doubtful = camera.model_copy(update={"focal_length_sigma": 2e-3})
    truth = true_pose(camera)
    seen = observation_of(scene_of(camera), truth)
    claimed = truth.with_range_factor(1.0005)
    exact, unsure = (find_pose_jointly(seen, truth, claimed, prior, scene_of(c), ONCE) for c in (camera, doubtful))
    free = [found.uncertainty["range_factor_free"] for found in (exact, unsure)]
    assert np.sqrt(free[1] ** 2 - free[0] ** 2) == pytest.approx(2e-3, rel=1e-6)
    sigma = getattr(ONCE.priors, prior).range_sigma(claimed.range_km)
    for found, own in zip((exact, unsure), free, strict=True):
        assert found.uncertainty["range_factor"] == pytest.approx((own**-2 + sigma**-2) ** -0.5, rel=1e-6)
    # The less the image says, the nearer the product is to the claimed range.
    away = [abs(found.pose.range_km / claimed.range_km - 1) for found in (exact, unsure)]
    assert away[1] < away[0]
    held = find_pose_jointly(
        seen, truth, claimed, prior, scene_of(doubtful), ONCE.model_copy(update={"hold": ("range",)})
    )
    assert held.uncertainty["range_factor"] is None
    assert not np.array(held.evidence["covariance"])[RANGE].any()


def test_priors_of_position_are_kilometres_whatever_the_range() -> None:
    near, far = (prior_sigmas(ONCE.priors.spice, range_km)[RANGE] for range_km in (1e4, 1e6))
    assert near * 1e4 == pytest.approx(far * 1e6) == pytest.approx(20.0)
    assert prior_sigmas(ONCE.priors.file, 1e4)[RANGE] == pytest.approx(0.02)
    both = ONCE.priors.spice.model_copy(update={"range_share": 3e-4})
    assert both.range_sigma(5e4) == pytest.approx(5e-4)


@pytest.mark.parametrize("prior_deg", [0.1, 0.3])
def test_a_roll_may_be_known_better_than_by_its_prior(prior_deg: float) -> None:
    """A textured disk shows it; what laws feign of it is all that is added."""
    camera = small_camera(90.0, (124, 124)).model_copy(update={"centre_px": (61.5, 61.5)})
    scene, truth = scene_of(camera, photometry="mixture"), true_pose(camera, phase_deg=40.0)
    start = State(truth, camera.psf_sigma_px)
    sigmas = prior_sigmas(ONCE.priors.spice.model_copy(update={"roll_deg": prior_deg}), truth.range_km)
    found = estimated(Problem(observation_of(scene, truth), scene, start, sigmas, ONCE), start)
    assert ONCE.systematic.roll_deg < np.sqrt(found.covariance[ROLL, ROLL]) < prior_deg


def test_how_a_map_lies_in_its_bodys_frame_comes_from_the_body_or_half_a_pixel() -> None:
    camera = small_camera(90.0, (124, 124))
    scene = scene_of(camera)
    assert scene.map_frame_deg == find_target("europa").map_frame_deg == 0.1
    unknown = scene.target.model_copy(update={"map_frame_deg": None})
    rows = scene.basemap.albedo.shape[0]
    assert replace(scene, target=unknown).map_frame_deg == pytest.approx(0.5 * 180 / rows)
    plain = replace(scene.basemap, albedo=np.ones_like(scene.basemap.albedo))
    assert replace(scene, target=unknown, basemap=plain).map_frame_deg == 0
