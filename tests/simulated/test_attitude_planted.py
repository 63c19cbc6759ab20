"""Planted turns of the target are found again; where the image cannot tell, that is the answer."""

import numpy as np
import pytest

from catalog.basemap import uniform_map
from catalog.observation import Observation
from catalog.rotation import rotation_from_vector_deg
from lab.simulate.plant import planted, pose_error
from lab.simulate.small_world import EUROPA, flagged, observation_of, scene_of, small_camera, true_pose
from tasks.attitude import AttitudeSettings, find_attitude
from tasks.correction import Correction

CAMERA = small_camera(diameter_px=200, size_px=(240, 232)).model_copy(update={"centre_px": (113.3, 121.6)})
SCENE = scene_of(CAMERA)
TRUTH = true_pose(CAMERA)
AXIS = np.array([0.36, -0.48, 0.8])
BAR_DEG = 0.05


@pytest.fixture(scope="module")
def observation() -> Observation:
    return observation_of(SCENE, TRUTH)


def turned_back(observation: Observation, vector_deg: np.ndarray, photometry: str = "lunar-lambert") -> Correction:
    wrong = planted(TRUTH, CAMERA, (0, 0), 1, vector_deg)
    return find_attitude(observation, wrong, scene_of(CAMERA, photometry), AttitudeSettings())


def left_deg(found: Correction) -> float:
    return pose_error(found.pose, TRUTH, CAMERA, EUROPA).attitude_deg


@pytest.mark.parametrize("photometry", ["lunar-lambert", "mixture"])
@pytest.mark.parametrize("turn_deg", [1.0, 3.0])
def test_a_planted_turn_is_recovered(observation: Observation, turn_deg: float, photometry: str) -> None:
    found = turned_back(observation, turn_deg * AXIS, photometry)
    sigma = np.linalg.norm(found.evidence["formal"]["attitude_deg"])
    print(f"turn of {turn_deg} deg: {left_deg(found):.4f} deg left, 1-sigma {sigma:.4f}, bar {BAR_DEG}")
    assert left_deg(found) < BAR_DEG
    # What the map's frame and the disk's place may be off by is stated, too.
    assert (np.array(found.uncertainty["attitude_deg"]) > 0.1).all()
    assert found.changed["attitude_deg"] == pytest.approx(turn_deg * AXIS, abs=BAR_DEG)
    assert found.evidence["correlation_after"] > found.evidence["correlation_before"]
    np.testing.assert_array_equal(found.pose.camera_from_j2000, TRUTH.camera_from_j2000)
    assert found.pose.range_km == TRUTH.range_km


@pytest.mark.parametrize("axis", np.eye(3), ids=["x", "y", "z"])
def test_the_rotation_vector_has_the_sign_and_axes_of_the_body_frame(observation: Observation, axis) -> None:
    found = turned_back(observation, 3 * axis)
    print(f"3 deg: {left_deg(found):.4f} deg left, settled {found.converged} in {len(found.evidence['turns'])} turns")
    assert found.changed["attitude_deg"] == pytest.approx(3 * axis, abs=BAR_DEG)
    assert left_deg(found) < BAR_DEG
    assert found.converged
    assert found.evidence["settled"]
    again = (
        rotation_from_vector_deg(found.changed["attitude_deg"]).T
        @ planted(TRUTH, CAMERA, (0, 0), 1, 3 * axis).body_from_j2000
    )
    assert found.pose.body_from_j2000 == pytest.approx(again, abs=1e-9)


def test_a_right_attitude_stays_within_its_error(observation: Observation) -> None:
    found = turned_back(observation, np.zeros(3))
    if found.changed["attitude_deg"] is None:
        assert "less alike" in found.evidence["undetermined"]
    vector = np.array(found.changed["attitude_deg"] or np.zeros(3))
    sigma = np.array(found.evidence.get("formal", {}).get("attitude_deg") or np.full(3, 0.02))
    print(f"no turn: found {vector.round(4)} deg, 1-sigma {sigma.round(4)}")
    assert (np.abs(vector) < 4 * sigma).all()
    assert left_deg(found) < 0.03


def test_a_turn_seen_along_the_line_of_sight_is_found(observation: Observation) -> None:
    sight = TRUTH.spacecraft_in_body_km / TRUTH.range_km
    found = turned_back(observation, 1.5 * sight)
    assert found.changed["attitude_deg"] == pytest.approx(1.5 * sight, abs=BAR_DEG)


def test_a_bland_map_leaves_the_attitude_undetermined(observation: Observation) -> None:
    found = find_attitude(observation, TRUTH, scene_of(CAMERA, basemap=uniform_map()), AttitudeSettings())
    assert found.changed == {"attitude_deg": None}
    assert found.uncertainty == {"attitude_deg": None}
    assert "bland" in found.evidence["undetermined"]
    assert found.pose is TRUTH


def test_a_bland_image_leaves_the_attitude_undetermined() -> None:
    bland = observation_of(scene_of(CAMERA, basemap=uniform_map()), TRUTH)
    found = find_attitude(bland, TRUTH, SCENE, AttitudeSettings())
    assert found.changed == {"attitude_deg": None}
    assert found.pose is TRUTH


def test_a_turn_too_large_for_the_search_is_not_made_up(observation: Observation) -> None:
    wrong = planted(TRUTH, CAMERA, (0, 0), 1, 25 * AXIS)
    found = find_attitude(observation, wrong, SCENE, AttitudeSettings())
    print(f"turn of 25 deg: {found.evidence.get('undetermined')}")
    assert found.changed["attitude_deg"] is None
    assert found.evidence["undetermined"]
    assert found.pose is wrong
    # Markings that do not match are a doubt about the whole image, not just a missing figure.
    assert found.evidence["doubt"].startswith("markings-do-not-match")


@pytest.mark.parametrize(("turn_deg", "prior_deg", "max_deg"), [(3, 0.3, None), (6, 1.5, None), (6, 3, 1.0)])
def test_a_turn_beyond_its_prior_is_assumed_where_the_markings_bear_it_out(
    observation: Observation, turn_deg: float, prior_deg: float, max_deg: float | None
) -> None:
    wrong = planted(TRUTH, CAMERA, (0, 0), 1, turn_deg * AXIS)
    found = find_attitude(observation, wrong, SCENE, AttitudeSettings(max_deg=max_deg), prior_deg=prior_deg)
    assert found.changed["attitude_deg"] == pytest.approx(turn_deg * AXIS, abs=BAR_DEG)
    assert "doubt" not in found.evidence


@pytest.mark.parametrize(
    ("sigmas", "prior_deg", "max_deg", "assumed"),
    [
        (4.0, 0.9, None, False),
        (4.0, 1.1, None, True),
        (9.0, 0.9, None, True),
        (4.0, 1.1, 2.0, False),
        (4.0, 0.9, 4.0, True),
        (None, 0.9, None, False),
    ],
)
def test_weak_markings_do_not_outweigh_the_prior(
    observation: Observation,
    monkeypatch: pytest.MonkeyPatch,
    sigmas: float | None,
    prior_deg: float,
    max_deg: float | None,
    assumed: bool,
) -> None:
    from tasks.attitude import solve
    from tasks.attitude.markings import Markings

    weak = Markings("undetermined") if sigmas is None else Markings("matched", 0.5, sigmas)
    monkeypatch.setattr(solve, "markings_at_pose", lambda *_: weak)
    settings = AttitudeSettings(max_deg=max_deg)
    reason = solve.why_not_so_far(observation, TRUTH, 3 * AXIS, SCENE, settings, prior_deg)
    assert (reason is None) == assumed
    assert assumed or f"limit {max_deg or 3 * prior_deg:g} deg" in str(reason)


def test_unusable_pixels_are_left_out(observation: Observation) -> None:
    lost = np.zeros(observation.image.shape, bool)
    lost[20::45, 20::45] = True
    lost[100:125, 100:140] = True
    found = turned_back(flagged(observation, lost), 1.0 * AXIS)
    print(f"with flagged NaN: {left_deg(found):.4f} deg left, {found.evidence['turns'][-1]['vectors']} vectors")
    assert left_deg(found) < BAR_DEG
