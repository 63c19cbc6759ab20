"""What the residuals say of brightness, places and the sky, and how sure the solution then is."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lab.simulate.small_world import clean_image, observed, scene_of, small_camera, true_pose
from tasks.joint import JointSettings
from tasks.joint.coarse_to_fine import prior_sigmas
from tasks.joint.contradiction import chi_square, growth_of
from tasks.joint.gauss_newton import Solution, solve_joint
from tasks.joint.limb_observation import limb_observation
from tasks.joint.outline import outline
from tasks.joint.parameters import OFFSET, RANGE, State
from tasks.joint.problem import Problem
from tasks.joint.pyramid import Level
from tasks.joint.uncertainty import covariance, of_the_camera
from tasks.joint.variance_model import _surplus

SETTINGS = JointSettings(second_start=False, oversample=2)
CAMERA = small_camera(60.0, (90, 88)).model_copy(update={"centre_px": (44.5, 43.5)})
TRUTH = true_pose(CAMERA)


@cache
def solved(noise_dn: float = 1.0, veil_dn: float = 0.0) -> Solution:
    """veil_dn: of uneven light in the sky, which no model has."""
    image = clean_image(scene_of(CAMERA), TRUTH)
    y, x = np.indices(image.shape)
    image = image + veil_dn * np.sin(x / 6.0) * np.cos(y / 5.0)
    start = State(TRUTH, CAMERA.psf_sigma_px)
    given = Problem(
        observed(image, noise_dn), scene_of(CAMERA, "mixture"), start, prior_sigmas(SETTINGS.priors.file, 1e6), SETTINGS
    )
    return solve_joint(given, start)


def test_light_in_the_sky_that_no_model_has_is_learned() -> None:
    clean, veiled = solved().variances, solved(veil_dn=6.0).variances
    print(f"sky {clean.sky:.2f}, {veiled.sky:.2f}; relative {clean.relative:.4f}, {veiled.relative:.4f}")
    assert clean.sky < 2
    assert veiled.sky > 5 * clean.sky


def test_learned_errors_stay_within_their_limits() -> None:
    limits = SETTINGS.thresholds.variance
    for solution in (solved(), solved(veil_dn=6.0)):
        found = solution.variances
        assert limits.least_relative <= found.relative <= limits.most_relative
        assert limits.least_edge_px <= found.edge_px <= SETTINGS.edge_px
        assert found.shared >= 1


@pytest.mark.parametrize("share", [0.0, 0.003, 0.05])
def test_an_error_beyond_the_noise_is_learned(share: float) -> None:
    random = np.random.default_rng(1)
    size, noise = np.full(40_000, 200.0), np.full(40_000, 1.0)
    residual = random.normal(0, np.hypot(noise, share * size))
    assert _surplus(residual, noise, size, 0.2) == pytest.approx(share, rel=0.05, abs=1e-3)
    assert _surplus(residual, noise, size, 0.001) <= 0.001
    assert _surplus(residual, noise, np.zeros_like(size), 0.2) <= 0.2


def test_weights_fall_at_the_terminator_and_are_none_where_nothing_is_known() -> None:
    solution = solved()
    weights = solution.fit.values[: len(solution.model.bases)]
    sure, unsure = (
        replace(solution.variances, dusk=dusk).weight(solution.model, solution.data, weights, SETTINGS)
        for dusk in (1e-6, 0.3)
    )
    inside = (solution.model.coverage > 0.99) & solution.data.usable
    dusk, day = inside & (solution.model.mu0 < 0.1), inside & (solution.model.mu0 > 0.8)
    assert np.median(unsure[dusk] / sure[dusk]) < 0.5
    assert np.median(unsure[day] / sure[day]) > 0.9
    assert (unsure[~solution.data.usable] == 0).all()


def test_the_stated_covariance_is_never_below_that_of_independent_pixels() -> None:
    solution = solved()
    formal = np.diag(solution.fit.covariance)[-8:]
    assert (np.diag(covariance(solution.problem, solution.fit)) >= formal * (1 - 1e-9)).all()


def test_more_noise_is_less_known() -> None:
    little, much = (np.diag(covariance(s.problem, s.fit)) for s in (solved(0.5), solved(4.0)))
    assert (much[:3] > 2 * little[:3]).all()


def test_the_focal_length_scales_the_range_alone() -> None:
    variance = of_the_camera(CAMERA.model_copy(update={"focal_length_sigma": 3e-4}))
    assert variance[RANGE, RANGE] == pytest.approx(9e-8)
    assert np.count_nonzero(variance) == 1


def test_the_limb_of_a_true_pose_lies_where_it_is() -> None:
    solution = solved()
    level = Level.of(solution.given, solution.given.metadata, SETTINGS.diameter_px)
    seen = limb_observation(level, solution.given.metadata, SETTINGS.thresholds.contradiction.limb_sky_px)
    print(f"step {np.round(seen.step, 4)}, {seen.rms_px:.3f} px RMS")
    assert (np.abs(seen.step) < 4 * np.sqrt(np.diag(seen.covariance))).all()
    moved = np.zeros(8)
    moved[OFFSET] = 0.4, 0.0
    assert seen.after(moved).step[0] == pytest.approx(seen.step[0] - 0.4)


def test_the_outline_is_the_disks_radius_all_round_and_lit_towards_the_sun() -> None:
    angle = np.linspace(-np.pi, np.pi, 36, endpoint=False)
    distance, lit = outline(TRUTH, scene_of(CAMERA), angle)
    assert distance == pytest.approx(np.full(36, 30.0), rel=5e-3)
    sun = TRUTH.camera_from_j2000 @ TRUTH.sun_from_target_km
    toward = np.cos(angle - np.arctan2(sun[1], sun[0]))
    assert lit[toward > 0.3].all()
    assert not lit[toward < -0.3].any()


@pytest.mark.parametrize(("freedom", "chance", "expected"), [(1, 0.01, 6.635), (3, 0.01, 11.345), (3, 1e-4, 21.108)])
def test_chance_is_that_of_the_tables(freedom: int, chance: float, expected: float) -> None:
    assert chi_square(freedom, chance) == pytest.approx(expected, abs=1e-3)


def test_errors_grow_until_a_difference_is_no_surprise() -> None:
    own, others, wanted = np.diag([0.01, 0.04]), np.diag([0.01, 0.01]), np.array([1.0, 0.5])
    factor = growth_of(own, others, wanted)
    assert wanted @ np.linalg.solve(factor * own + others, wanted) == pytest.approx(2.0, rel=0.01)
    assert growth_of(own, others, 0.05 * wanted) == 1.0
