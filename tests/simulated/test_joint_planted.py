"""Planted truth for the joint estimator: matched and mismatched simulations, its own errors, what it cannot tell."""

from dataclasses import replace

import numpy as np
import pytest
from cramer_rao import cramer_rao

from catalog.basemap import BaseMap
from catalog.camera import Camera
from catalog.pose import Pose
from lab.simulate.plant import planted, pose_error
from lab.simulate.small_world import (
    NOISE_DN,
    image_by_laws,
    observation_of,
    observed,
    scene_of,
    small_camera,
    true_pose,
)
from tasks.joint import JointSettings, find_pose_jointly
from tasks.joint.coarse_to_fine import estimated, prior_sigmas
from tasks.joint.parameters import ATTITUDE, NAMES, PSF, RANGE, ROLL, State, difference, rolled
from tasks.joint.problem import Problem
from tasks.joint.settings import SystematicSettings
from tasks.priors import PriorSettings
from tasks.simulate import Scene

DIAMETER_PX = 90.0
LOOSE = PriorSettings(range_km=None, roll_deg=0.2, attitude_deg=3.0, psf_relative=0.3)
ONCE = JointSettings(second_start=False)
SEEDS = 12
# RMS error over the Cramer-Rao bound, for each unknown.
BARS = 1.5
NO_FLOOR = SystematicSettings(centre_px=0, limb_px=0, attitude_deg=0, roll_deg=0)


@pytest.fixture(scope="module")
def camera() -> Camera:
    return small_camera(DIAMETER_PX, (124, 124)).model_copy(update={"centre_px": (61.5, 61.5)})


@pytest.fixture(scope="module")
def scene(camera: Camera) -> Scene:
    return scene_of(camera)


@pytest.fixture(scope="module")
def truth(camera: Camera) -> Pose:
    return true_pose(camera)


def wrong(truth: Pose, camera: Camera) -> Pose:
    return planted(truth, camera, (0.8, -0.6), 1.004, (0.3, -0.2, 0.25))


def test_matched_images_are_solved_about_as_well_as_noise_allows(camera: Camera, scene: Scene, truth: Pose) -> None:
    sigmas, planted_state = prior_sigmas(LOOSE, truth.range_km), State(truth, 0.8)
    settings = ONCE.model_copy(update={"systematic": NO_FLOOR})
    image = image_by_laws(scene, truth, {"lambert": 0.4, "lommel-seeliger": 0.6})
    start = State(wrong(truth, camera), 0.8)
    errors = []
    for seed in range(SEEDS):
        seen = observed(image, 2 * NOISE_DN, seed)
        given = Problem(seen, scene, planted_state, sigmas, settings)
        found = estimated(given, start)
        errors.append(difference(found.state, planted_state, camera))
    bound = cramer_rao(given, planted_state)
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    print("mean", np.round(np.mean(errors, axis=0), 5), "std", np.round(np.std(errors, axis=0), 5))
    for name, seen_error, least in zip(NAMES, rms, bound, strict=True):
        print(f"{name}: RMS {seen_error:.5f}, Cramer-Rao {least:.5f}, ratio {seen_error / least:.2f}")
    assert (rms < BARS * bound).all()


@pytest.mark.parametrize("law", ["lambert", "lommel-seeliger"])
def test_a_surface_unlike_the_estimators_hardly_moves_the_pose(
    camera: Camera, scene: Scene, truth: Pose, law: str
) -> None:
    other = scene_of(camera, law, psf_sigma_px=0.95)
    start = wrong(truth, camera)
    one_law = ONCE.model_copy(update={"mapped": ("lunar-lambert",), "plain": ()})
    found = find_pose_jointly(observation_of(other, truth), start, start, "file", scene, one_law)
    error = pose_error(found.pose, truth, camera, scene.target)
    print(f"{law} seen, lunar-Lambert simulated: {error}, blur {found.changed['psf_sigma_px']:.2f} px (0.95)")
    assert np.hypot(*error.centre_px) < 0.1
    assert abs(error.range) < 3e-3
    assert found.changed["psf_sigma_px"] == pytest.approx(0.95, abs=0.12)


def test_a_known_range_is_kept_and_the_image_free_one_is_reported(camera: Camera, scene: Scene, truth: Pose) -> None:
    start = planted(truth, camera, (0.5, 0.4), 1.0, (0, 0, 0))
    found = find_pose_jointly(observation_of(scene, truth), start, start, "spice", scene, ONCE)
    free, sigma = found.changed["range_factor_free"], found.uncertainty["range_factor_free"]
    print(f"free {free:.5f} +- {sigma:.5f}, product {found.changed['range_factor']:.6f}")
    assert abs(free - 1) < 3 * sigma
    assert found.uncertainty["range_factor"] < 2.1e-4 < sigma
    assert abs(found.changed["range_factor"] - 1) < abs(free - 1) or abs(free - 1) < 1e-5


def test_a_range_against_the_trajectory_is_doubted(camera: Camera, scene: Scene, truth: Pose) -> None:
    start = planted(truth, camera, (0.5, 0.4), 1.02, (0, 0, 0))
    found = find_pose_jointly(observation_of(scene, truth), start, start, "spice", scene, ONCE)
    assert "range-conflict" in found.evidence["doubt"]


def test_turns_of_a_body_without_markings_are_left_to_the_prior(camera: Camera, truth: Pose) -> None:
    albedo = np.ones((64, 128), np.float32)
    albedo[20, 30] = 1.0001
    bland = scene_of(camera, basemap=BaseMap("bland", albedo, 0.0, "bland"))
    found = find_pose_jointly(observation_of(bland, truth), truth, truth, "file", bland, ONCE)
    names = [name for direction in found.evidence["held_by_prior"] for name in direction["direction"]]
    assert {"attitude_x", "attitude_y", "attitude_z"} <= set(names)


def test_half_of_the_disk_is_enough(camera: Camera, scene: Scene, truth: Pose) -> None:
    seen = observation_of(scene, truth)
    quality = seen.quality.copy()
    quality[:, 62:] |= np.uint16(512)
    start = wrong(truth, camera)
    whole, half = (
        find_pose_jointly(o, start, start, "file", scene, ONCE) for o in (seen, replace(seen, quality=quality))
    )
    apart = np.subtract(whole.changed["offset_px"], half.changed["offset_px"])
    sigma = np.hypot(whole.uncertainty["offset_px"], half.uncertainty["offset_px"])
    print(f"half: {apart} px away, sigma {sigma}")
    assert (np.abs(apart) < 3 * sigma).all()


def test_steps_between_states_are_found_again(camera: Camera, truth: Pose) -> None:
    start = State(truth, 0.8)
    step = np.array([3.0, -2.0, 0.004, 1.5, 0.4, -0.3, 0.2, 0.1])
    again = difference(start.moved(step, camera), start, camera)
    assert again == pytest.approx(step, abs=2e-3)
    assert again[[RANGE, PSF]] == pytest.approx(step[[RANGE, PSF]], abs=1e-12)
    assert again[ATTITUDE] == pytest.approx(step[ATTITUDE], abs=1e-9)


def test_a_roll_turns_the_picture_from_x_towards_y(camera: Camera, truth: Pose) -> None:
    turned = rolled(truth, 90.0)
    sun = [pose.camera_from_j2000 @ pose.sun_from_target_km for pose in (truth, turned)]
    sight = truth.target_in_camera_km / truth.range_km
    assert turned.target_in_camera_km == pytest.approx(truth.target_in_camera_km, rel=1e-9)
    assert np.cross(sight, sun[0]) == pytest.approx(
        sun[1] - (sun[1] @ sight) * sight, abs=1e-6 * float(np.linalg.norm(sun[0]))
    )
    assert NAMES[ROLL] == "roll"
