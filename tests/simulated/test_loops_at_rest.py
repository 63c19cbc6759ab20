"""Loops that render anew stand still within their own error: planted behaviours of what each of them repeats."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tasks.attitude.solve as attitude
import tasks.range.limb as by_limb
import tasks.roll.solve as roll
from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.rotation import rotation_from_vector_deg
from lab.simulate.plant import planted, pose_error
from lab.simulate.small_world import EUROPA, observation_of, scene_of, small_camera, true_pose
from tasks.attitude import AttitudeSettings, find_attitude
from tasks.compare.limb_fit import LimbFit
from tasks.compare.match import Match
from tasks.correction import FORMAL
from tasks.point import PointSettings, find_pointing
from tasks.point.registration import REGISTRATIONS, Shift
from tasks.roll import RollSettings, find_roll
from tasks.roll.refine import TurnStep

Array = NDArray[np.float64]
# What a method adds to the true move, by the number of the call: here the pixels' samples lead it astray.
Error = Callable[[int, Array], Array]

CAMERA = small_camera(diameter_px=40, size_px=(64, 60))
SCENE = scene_of(CAMERA, oversample=2)
TRUTH = true_pose(CAMERA)
ALONG = np.array([0.8, 0.6])


@cache
def observation() -> Observation:
    return observation_of(SCENE, TRUTH)


def constant(size: float) -> Error:
    return lambda count, left: size * ALONG


def alternating(size: float) -> Error:
    """The answer lies now on this side of the truth, now on the other."""
    return lambda count, left: size * (-1) ** count * ALONG


def scaled(factor: float) -> Error:
    """The move is `factor` times what it should be."""
    return lambda count, left: (factor - 1) * left


def drifting(size: float) -> Error:
    """However far it has come, as much is left."""
    return lambda count, left: size * ALONG - left


def planted_registration(error: Error) -> Callable[[Match], Shift]:
    calls: list[int] = []

    def register(match: Match) -> Shift:
        left = CAMERA.project(TRUTH.target_in_camera_km) - CAMERA.project(match.pose.target_in_camera_km)
        calls.append(len(calls))
        return Shift(left + error(len(calls), left), 1e-6 * np.eye(2), 1, 0.99)

    return register


def pointed(monkeypatch: pytest.MonkeyPatch, error: Error) -> Any:
    monkeypatch.setitem(REGISTRATIONS, "ncc", planted_registration(error))
    wrong = planted(TRUTH, CAMERA, (0.7, -0.4), 1, (0, 0, 0))
    return find_pointing(observation(), wrong, SCENE, PointSettings(registration="ncc", coarse=False))


@pytest.mark.parametrize(
    ("error", "away_px", "scatter_px"),
    [(constant(0.03), 0.03, 0.0), (alternating(0.0105), 0.003, 0.0105), (alternating(0.04), 0.003, 0.04)],
    ids=["constant bias above the stop", "to and fro just above the stop", "to and fro well above it"],
)
def test_pointing_converges_where_it_moves_no_more_than_its_own_error(
    monkeypatch: pytest.MonkeyPatch, error: Error, away_px: float, scatter_px: float
) -> None:
    found = pointed(monkeypatch, error)
    centre = pose_error(found.pose, TRUTH, CAMERA, EUROPA).centre_px
    assert np.hypot(*centre) == pytest.approx(away_px, abs=0.003)
    assert np.hypot(*found.evidence[FORMAL]["offset_px"]) == pytest.approx(scatter_px, abs=0.002)
    assert ("scatter_px" in found.evidence) == (scatter_px > 0)


@pytest.mark.parametrize(
    "error",
    [alternating(0.3), scaled(2.3), scaled(2.0), drifting(0.03), drifting(0.5)],
    ids=["swings far", "swings ever farther", "swings as far as at the start", "creeps on", "runs away"],
)
def test_pointing_that_swings_far_or_leads_on_has_not_converged(monkeypatch: pytest.MonkeyPatch, error: Error) -> None:
    with pytest.raises(FailedError, match="pointing did not converge in 12 iterations") as failure:
        pointed(monkeypatch, error)
    assert failure.value.code == "did-not-converge"


def limb_fit(error: Error) -> Callable[..., LimbFit]:
    calls: list[int] = []

    def fit(edges: Any, centre_px: Array, solve_growth: bool, min_points: int) -> LimbFit:
        left = CAMERA.project(TRUTH.target_in_camera_km) - centre_px
        calls.append(len(calls))
        wrong = error(len(calls), left)
        certain, edges_of_all_sides = 1e-8 * np.eye(3), np.linspace(0, 360, 37)[:-1]
        design = np.column_stack([*(f(np.radians(edges_of_all_sides)) for f in (np.cos, np.sin)), np.full(36, 20.0)])
        return LimbFit(left + wrong, float(wrong[0]) / 20, certain, certain, 0.01, design, edges_of_all_sides)

    return fit


def test_the_limbs_range_is_the_middle_of_where_it_goes_to_and_fro(monkeypatch: pytest.MonkeyPatch) -> None:
    """The growth alternates by 0.04 px at the limb around nothing; so does the centre."""
    monkeypatch.setattr(by_limb, "fit_limb", limb_fit(alternating(0.03)))
    exact = by_limb.LimbRangeSettings(centre_px=0, radius_px=0)
    found = by_limb.find_range_by_limb(observation(), TRUTH, SCENE, exact)
    assert np.hypot(*pose_error(found.pose, TRUTH, CAMERA, EUROPA).centre_px) < 0.003
    assert 0.5 * 0.024 / 20 < found.uncertainty["range_factor"] < 2 * 0.024 / 20
    monkeypatch.setattr(by_limb, "fit_limb", limb_fit(alternating(0.3)))
    with pytest.raises(FailedError, match="did not settle in 12 iterations"):
        by_limb.find_range_by_limb(observation(), TRUTH, SCENE, by_limb.LimbRangeSettings())


def turn_steps(size_deg: float) -> Callable[..., TurnStep]:
    calls: list[int] = []

    def step(match: Match, kind: str, radius_px: float) -> TurnStep:
        calls.append(len(calls))
        return TurnStep(np.zeros(2), size_deg * (-1) ** len(calls), 0.001)

    return step


@pytest.mark.parametrize(("size_deg", "settles"), [(0.1, True), (0.4, True), (4.0, False)])
def test_a_roll_that_goes_to_and_fro_within_a_tenth_of_a_pixel_has_settled(
    monkeypatch: pytest.MonkeyPatch, size_deg: float, settles: bool
) -> None:
    """0.4 deg are 0.14 px at the limb of this disk, 0.07 px on either side of the middle."""
    monkeypatch.setattr(roll, "turn_step", turn_steps(size_deg))
    found = find_roll(observation(), TRUTH, SCENE, RollSettings(assign="camera", reach_deg=0))
    assert found.evidence["settled"] is settles
    if settles:
        assert found.changed["roll_deg"] == pytest.approx(-size_deg / 2, abs=1e-6)
        assert found.evidence[FORMAL]["roll_deg"] == pytest.approx(size_deg / 2, rel=0.01)


def planted_turns(vectors: Callable[[int], Array]) -> Callable[..., attitude.Turn]:
    calls: list[int] = []

    def turn(match: Match, settings: AttitudeSettings) -> attitude.Turn:
        calls.append(len(calls))
        vector = vectors(len(calls))
        pose = match.pose.replaced(body_from_j2000=rotation_from_vector_deg(vector).T @ match.pose.body_from_j2000)
        return attitude.Turn(pose, vector, np.full(3, 0.001), {"vectors": 300})

    return turn


@pytest.mark.parametrize(
    ("vectors", "settles"),
    [
        (lambda n: np.array([0.0, 0.1, 0.05]) * (-1) ** n, True),
        (lambda n: np.array([0.0, 0.03, 0.0]), False),
        (lambda n: np.array([0.0, 1.0, 0.0]) * (-1) ** n, False),
    ],
    ids=["to and fro", "creeps on", "swings far"],
)
def test_an_attitude_that_goes_to_and_fro_within_a_tenth_of_a_pixel_has_settled(
    monkeypatch: pytest.MonkeyPatch, vectors: Callable[[int], Array], settles: bool
) -> None:
    monkeypatch.setattr(attitude, "one_turn", planted_turns(vectors))
    monkeypatch.setattr(attitude, "why_not", lambda *_: None)
    found = find_attitude(observation(), TRUTH, SCENE, AttitudeSettings())
    assert found.converged is settles
    if settles:
        assert np.linalg.norm(found.changed["attitude_deg"]) == pytest.approx(np.hypot(0.1, 0.05) / 2, rel=0.01)
        assert np.linalg.norm(found.evidence[FORMAL]["attitude_deg"]) == pytest.approx(
            np.hypot(0.1, 0.05) / 2, rel=0.05
        )
