"""Where brightness and markings pull the joint solution off the limb, the limb leads."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from catalog.basemap import BaseMap
from catalog.observation import Observation
from lab.simulate.plant import planted, pose_error
from lab.simulate.small_world import EUROPA, clean_image, europa_map, observed, scene_of, small_camera, true_pose
from tasks.compare.limb_errors import limb_covariance, relief_covariance, shared_along
from tasks.joint import JointSettings
from tasks.joint.coarse_to_fine import Estimate, estimated, prior_sigmas, with_range_prior
from tasks.joint.contradiction import chi_square, growth_of
from tasks.joint.limb_update import (
    LimbObservation,
    Witnesses,
    doubt_of_limb,
    fits_better,
    updated_by_limb,
    with_the_other,
)
from tasks.joint.parameters import NAMES, OFFSET, RANGE, State
from tasks.joint.problem import Problem
from tasks.simulate import Scene

SETTINGS = JointSettings(second_start=False, oversample=2)
SIGMAS = prior_sigmas(SETTINGS.priors.file, 1.5e5)
LIMITS = SETTINGS.thresholds.contradiction
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
    0.9, -0.6 px and 0.4 % of range off, stated to 0.1 px."""
    clean = clean_image(scene_of(CAMERA), TRUTH)
    veil = sum(0.1 * np.exp(-step / 6) / 6 * np.roll(clean - clean.min(), step, axis=1) for step in range(1, 40))
    seen = observed(clean + veil)
    scene = scene_of(CAMERA, "mixture", wrong_map(), oversample=3)
    start = State(planted(TRUTH, CAMERA, PULLED_PX, PULLED_RANGE, (0, 0, 0)), CAMERA.psf_sigma_px)
    held = SETTINGS.model_copy(update={"hold": ("offset", "range")})
    there = estimated(Problem(seen, scene, start, SIGMAS, held), start)
    freed = replace(there.free, held=np.zeros(len(NAMES), bool))
    assumed = there.free_covariance.copy()
    assumed[OFFSET, OFFSET] = np.diag([0.01, 0.01])
    assumed[RANGE, RANGE] = 0.002**2
    none = np.zeros_like(assumed)
    return seen, scene, replace(there, free=freed, free_covariance=assumed, covariance=assumed, common=none)


def test_an_estimate_that_was_pulled_off_the_limb_is_brought_back() -> None:
    seen, scene, pulled = pulled_away()
    led, reported = updated_by_limb(Problem(seen, scene, pulled.free_state, SIGMAS, SETTINGS), pulled)
    before, after = (pose_error(e.free_state.pose, TRUTH, CAMERA, EUROPA) for e in (pulled, led))
    sigmas = np.sqrt(np.diag(led.free_covariance))
    sigma = sigmas[OFFSET]
    assert reported is not None
    print(f"\ncentre {np.round(before.centre_px, 3)} px off, led by the limb {np.round(after.centre_px, 3)} +- {sigma}")
    print(f"range {before.range:+.5f}, {after.range:+.5f} +- {sigmas[RANGE]:.5f}")
    print(f"limb {np.round(reported['limb_px'], 3)} px; stated {reported['error_grown']:.1f} times too well")
    assert np.hypot(*before.centre_px) > 1
    assert np.hypot(*after.centre_px) < 0.25
    assert abs(after.range) < 3 * sigmas[RANGE]
    assert reported["limb_px"][1] < 0.2 < 0.5 < reported["limb_px"][0]
    assert reported["error_grown"] > 2
    assert (np.abs(after.centre_px) < 3 * sigma).all()


def test_what_the_limb_led_is_known_less_well_along_what_it_moved_by() -> None:
    _, scene, pulled = pulled_away()
    step = np.zeros(len(NAMES))
    step[OFFSET] = 0.6, -0.8
    away = pulled.free_state.moved(step, scene.camera)
    led = with_the_other(replace(pulled, free_state=away, state=away), pulled, scene.camera, LIMITS.led_wrong)
    for mine, before in ((led.covariance, pulled.covariance), (led.free_covariance, pulled.free_covariance)):
        more = (mine - before)[OFFSET, OFFSET]
        along, across = np.array([0.6, -0.8]), np.array([0.8, 0.6])
        assert (
            0.2 < np.sqrt(along @ more @ along) < 0.5
        )  # each of two equally likely answers would be 0.5 from the mean
        assert abs(across @ more @ across) < 1e-6


def test_the_limb_does_not_lead_where_it_is_not_requested() -> None:
    seen, scene, pulled = pulled_away()
    settings = SETTINGS.model_copy(update={"limb_led_px": None})
    assert updated_by_limb(Problem(seen, scene, pulled.free_state, SIGMAS, settings), pulled) == (pulled, None)


def test_a_limb_that_contradicts_the_errors_leads_however_many_pixels_are_allowed() -> None:
    seen, scene, pulled = pulled_away()
    settings = SETTINGS.model_copy(update={"limb_led_px": 5.0})
    led, reported = updated_by_limb(Problem(seen, scene, pulled.free_state, SIGMAS, settings), pulled)
    assert reported is not None
    assert np.hypot(*pose_error(led.free_state.pose, TRUTH, CAMERA, EUROPA).centre_px) < 0.25


def test_an_estimate_that_nothing_contradicts_stays() -> None:
    scene = scene_of(CAMERA, "mixture", oversample=3)
    seen = observed(clean_image(scene_of(CAMERA), TRUTH))
    start = State(TRUTH, CAMERA.psf_sigma_px)
    given = Problem(seen, scene, start, SIGMAS, SETTINGS)
    found = estimated(given, start)
    assert updated_by_limb(given, found) == (found, None)


def test_an_estimate_that_holds_centre_or_range_is_not_led() -> None:
    seen, scene, pulled = pulled_away()
    held = pulled.free.held.copy()
    held[RANGE] = True
    kept = replace(pulled, free=replace(pulled.free, held=held))
    assert updated_by_limb(Problem(seen, scene, kept.free_state, SIGMAS, SETTINGS), kept)[1] is None


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


OWN = np.diag([0.05, 0.05, 1e-3, 0.1, 0.1, 0.1, 0.1, 0.1]) ** 2


def limb_at(step: tuple[float, float, float], sigma_px: float = 0.1) -> LimbObservation:
    return LimbObservation(np.array(step), np.diag([sigma_px, sigma_px, sigma_px / 50]) ** 2, 0.1)


def test_a_free_range_against_trajectory_and_limb_speaks_against_the_solution() -> None:
    alone = Witnesses(OWN, limb_at((0.1, 0.0, 0.0025)), np.inf, np.inf, LIMITS.chance)
    assert not alone.contradict
    both = replace(alone, range_step=0.004, range_variance=(2e-4) ** 2)
    assert both.trusted_range
    assert both.contradict
    assert both.growth() > 3
    agreeing = replace(both, range_step=0.0005)
    assert not agreeing.contradict
    assert agreeing.growth() == 1.0


def test_a_trajectory_that_limb_and_solution_contradict_together_is_no_witness_against_it() -> None:
    """The target or its range is another: the solution keeps its errors, and the contradiction shows."""
    seen = Witnesses(OWN, limb_at((0.05, 0.0, 0.0005)), -0.05, (2e-4) ** 2, LIMITS.chance)
    assert not seen.trusted_range
    assert not seen.contradict


def test_a_solution_off_along_what_the_limb_leaves_open_is_not_contradicted() -> None:
    direction = np.array([1.0, 0.0, -0.02])
    open_to_it = LimbObservation(0.6 * direction, OWN[:3, :3] + np.outer(direction, direction), 0.1)
    assert not Witnesses(OWN, open_to_it, np.inf, np.inf, LIMITS.chance).contradict
    across = LimbObservation(np.array([0.0, 0.6, 0.0]), open_to_it.covariance, 0.1)
    assert Witnesses(OWN, across, np.inf, np.inf, LIMITS.chance).contradict


def test_a_product_that_is_not_where_the_limb_is_is_doubted() -> None:
    assert doubt_of_limb(limb_at((0.3, 0.0, 0.0)), OWN, LIMITS.chance_doubted) is None
    doubt = doubt_of_limb(limb_at((0.9, 0.0, 0.0)), OWN, LIMITS.chance_doubted)
    assert doubt is not None
    assert doubt.startswith("limb-and-interior-disagree: ")


@pytest.mark.parametrize("sigmas_off", [1.0, 3.5, 8.0])
def test_a_range_that_contradicts_its_prior_widens_the_product_s_errors(sigmas_off: float) -> None:
    seen, scene, there = pulled_away()
    prior = SIGMAS.copy()
    prior[RANGE] = 2e-4
    own = there.free_covariance.copy()
    own[0, RANGE] = own[RANGE, 0] = 0.8 * np.sqrt(own[0, 0] * own[RANGE, RANGE])
    found = replace(there, free_covariance=own)
    step = np.zeros(len(NAMES))
    step[RANGE] = -sigmas_off * np.hypot(0.002, 2e-4)
    calm, product = (
        with_range_prior(found, Problem(seen, scene, found.free_state.moved(share * step, CAMERA), prior, SETTINGS))
        for share in (0.0, 1.0)
    )
    grown = np.sqrt(product.covariance[0, 0] / calm.covariance[0, 0])
    assert grown == pytest.approx(sigmas_off if sigmas_off**2 > chi_square(1, LIMITS.chance) else 1.0, rel=0.1)
    assert np.array_equal(product.free_covariance, own)
    assert np.sqrt(product.covariance[RANGE, RANGE]) <= 2e-4


def test_the_errors_of_a_short_arc_are_long_along_its_bisector() -> None:
    """One pixel of centre towards the arc, and a disk smaller by as much, is nearly the same limb."""
    angle = np.radians(np.arange(-30, 30, 0.5))
    design = np.column_stack([np.cos(angle), np.sin(angle), np.full(len(angle), 50.0)])
    residual = 0.05 * np.random.default_rng(2).standard_normal(len(angle))
    degrees = np.degrees(angle) % 360
    for covariance in (
        limb_covariance(design, residual, np.ones(len(angle)), degrees),
        relief_covariance(design, degrees, 0.05),
    ):
        sigma = np.sqrt(np.diag(covariance))
        assert sigma[0] > 3 * sigma[1]
        assert covariance[0, 2] / (sigma[0] * sigma[2]) < -0.95


@pytest.mark.parametrize(
    ("before_px", "after_px", "parts", "better"),
    [
        (0.4, 0.29, 18, True),
        (1.13, 1.05, 18, False),
        (0.4, 0.29, 5, False),
        (1.0, 0.1, 5, True),
        (0.3, 0.31, 18, False),
    ],
)
def test_a_limb_leads_where_it_then_lies_nearer_by_more_than_chance(
    before_px: float, after_px: float, parts: float, better: bool
) -> None:
    before, after = (replace(limb_at((0, 0, 0)), rms_px=rms_px, independent=parts) for rms_px in (before_px, after_px))
    assert fits_better(after, before, LIMITS.chance) is better
