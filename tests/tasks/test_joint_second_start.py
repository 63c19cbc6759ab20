"""A start that ends elsewhere is a doubt where the image fits as well there, none where that is a false minimum."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from catalog.observation import Observation
from lab.simulate.small_world import clean_image, observed, scene_of, small_camera, true_pose
from tasks.joint import JointSettings, coarse_to_fine
from tasks.joint.coarse_to_fine import Estimate, estimated, prior_sigmas, second_start
from tasks.joint.gauss_newton import Solution
from tasks.joint.parameters import ROLL, State
from tasks.joint.problem import Problem

SETTINGS = JointSettings(oversample=2)
SIGMAS = prior_sigmas(SETTINGS.priors.file, 1.5e5)
CAMERA = small_camera(70.0, (100, 100)).model_copy(update={"centre_px": (49.5, 49.5)})
TRUTH = State(true_pose(CAMERA), CAMERA.psf_sigma_px)
AWAY = np.array([1.5, -1.0, 0, 0, 0, 0, 0, 0])


@cache
def solved() -> tuple[Observation, Estimate]:
    seen = observed(clean_image(scene_of(CAMERA), TRUTH.pose))
    return seen, estimated(Problem(seen, scene_of(CAMERA, "mixture"), TRUTH, SIGMAS, SETTINGS), TRUTH)


def second(found: Estimate) -> float | None:
    given = Problem(solved()[0], scene_of(CAMERA, "mixture"), TRUTH, SIGMAS, SETTINGS)
    return second_start(given, TRUTH, found)


def test_another_start_leads_to_the_same_solution() -> None:
    away = second(solved()[1])
    assert away is not None
    assert away < SETTINGS.thresholds.pyramid.disagreement_px


def test_a_solution_that_fits_worse_than_where_the_other_start_ends_is_reported() -> None:
    found = solved()[1]
    away = second(replace(found, free_state=found.free_state.moved(AWAY, CAMERA)))
    assert away == pytest.approx(np.hypot(1.5, 1.0), abs=0.1)


def test_a_start_that_is_caught_where_the_image_fits_worse_raises_no_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    solve = coarse_to_fine.solved_at

    def caught(*arguments: Any, **options: Any) -> Solution:
        other = solve(*arguments, **options)
        state = other.state.moved(AWAY, CAMERA)
        return replace(other, state=state, model=replace(other.model, state=state))

    monkeypatch.setattr(coarse_to_fine, "solved_at", caught)
    assert second(solved()[1]) is None


def test_the_roll_is_known_no_worse_than_by_its_prior_and_no_better_than_shading_tells() -> None:
    """Degrees; what laws get wrong is added to what the residuals show."""
    sigma = solved()[1].covariance[ROLL, ROLL] ** 0.5
    own = SETTINGS.systematic.roll_deg
    assert own < sigma <= np.hypot(SIGMAS[ROLL], own)
