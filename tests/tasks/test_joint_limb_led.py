"""Where brightness and markings pull the joint solution off the limb, the limb leads."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from catalog.basemap import BaseMap
from catalog.observation import Observation
from tasks.joint import JointSettings
from tasks.joint.estimate import Estimate, estimated, prior_sigmas
from tasks.joint.limb_led import growth_of, led_by_limb, shared_along
from tasks.joint.parameters import NAMES, OFFSET, RANGE, State
from tasks.paper.small_world import EUROPA, clean_image, europa_map, observed, scene_of, small_camera, true_pose
from tasks.simulate import Scene
from tasks.simulate.plant import planted, pose_error

SETTINGS = JointSettings(second_start=False, oversample=2)
SIGMAS = prior_sigmas(SETTINGS.priors.file)
PULLED_PX, PULLED_RANGE = (0.9, -0.6), 1.004
CAMERA = small_camera(90.0, (124, 124)).model_copy(update={"centre_px": (61.5, 61.5)})
TRUTH = true_pose(CAMERA)


def wrong_map() -> BaseMap:
    """The other side of the body, with twice the contrast."""
    ours = europa_map()
    other = np.roll(ours.albedo, ours.albedo.shape[1] // 2, axis=1)
    return replace(ours, albedo=np.maximum(1 + 2 * (other - 1), 0.1).astype(np.float32))


@cache
def pulled_away() -> tuple[Observation, Scene, Estimate]:
    """An image with light that trails from the disk to the right, and an estimate by a wrong map that something put
    0.9, -0.6 px and 0.4 % of range off, believed to 0.1 px."""
    clean = clean_image(scene_of(CAMERA), TRUTH)
    veil = sum(0.1 * np.exp(-step / 6) / 6 * np.roll(clean - clean.min(), step, axis=1) for step in range(1, 40))
    seen = observed(clean + veil)
    scene = scene_of(CAMERA, "mixture", wrong_map(), oversample=3)
    start = State(planted(TRUTH, CAMERA, PULLED_PX, PULLED_RANGE, (0, 0, 0)), CAMERA.psf_sigma_px)
    held = SETTINGS.model_copy(update={"hold": ("offset", "range")})
    there = estimated(seen, start, start, SIGMAS, scene, held)
    freed = replace(there.free, held=np.zeros(len(NAMES), bool))
    believed = there.free_covariance.copy()
    believed[OFFSET, OFFSET] = np.diag([0.01, 0.01])
    believed[RANGE, RANGE] = 0.002**2
    none = np.zeros_like(believed)
    return seen, scene, replace(there, free=freed, free_covariance=believed, covariance=believed, common=none)


def test_an_estimate_that_was_pulled_off_the_limb_is_brought_back() -> None:
    seen, scene, pulled = pulled_away()
    led, told = led_by_limb(seen, pulled, pulled.free_state, SIGMAS, scene, SETTINGS)
    before, after = (pose_error(e.free_state.pose, TRUTH, CAMERA, EUROPA) for e in (pulled, led))
    sigmas = np.sqrt(np.diag(led.free_covariance))
    sigma = sigmas[OFFSET]
    assert told is not None
    print(f"\ncentre {np.round(before.centre_px, 3)} px off, led by the limb {np.round(after.centre_px, 3)} +- {sigma}")
    print(
        f"range {before.range:+.5f}, {after.range:+.5f} +- {sigmas[RANGE]:.5f}; limb {np.round(told['limb_px'], 3)} px"
    )
    print(f"believed {told['error_grown']:.1f} times too well")
    assert np.hypot(*before.centre_px) > 1
    assert np.hypot(*after.centre_px) < 0.25
    assert abs(after.range) < 3 * sigmas[RANGE]
    assert told["limb_px"][1] < 0.2 < 0.5 < told["limb_px"][0]
    assert told["error_grown"] > 2
    assert (np.abs(after.centre_px) < 3 * sigma).all()


@pytest.mark.parametrize("change", [{"limb_led_px": None}, {"limb_led_px": 5.0}])
def test_the_limb_does_not_lead_where_it_is_not_asked_or_not_far_off(change: dict[str, float | None]) -> None:
    seen, scene, pulled = pulled_away()
    settings = SETTINGS.model_copy(update=change)
    assert led_by_limb(seen, pulled, pulled.free_state, SIGMAS, scene, settings) == (pulled, None)


def test_an_estimate_that_holds_centre_or_range_is_not_led() -> None:
    seen, scene, pulled = pulled_away()
    held = pulled.free.held.copy()
    held[RANGE] = True
    kept = replace(pulled, free=replace(pulled.free, held=held))
    assert led_by_limb(seen, kept, kept.free_state, SIGMAS, scene, SETTINGS)[1] is None


def test_a_covariance_grows_until_a_difference_is_no_surprise() -> None:
    own, limb = np.diag([0.01, 0.01, 1e-6]), np.diag([0.0025, 0.0025, 1e-6])
    assert growth_of(own, limb, np.array([0.1, 0.1, 0.0005])) == 1.0
    far = np.array([1.0, 0.0, 0.0])
    grown = growth_of(own, limb, far)
    assert far @ np.linalg.solve(grown * own + limb, far) == pytest.approx(3, rel=1e-2)


def test_segments_that_err_together_count_as_few() -> None:
    angle = np.arange(0, 180, 0.25)
    noise = np.random.default_rng(1).standard_normal(len(angle))
    wave = np.sin(np.radians(10 * angle))
    assert shared_along(wave, angle) > 4 * shared_along(noise, angle)
