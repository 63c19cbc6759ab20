"""Limb and interior of one solution: what relief does to it, and errors that are long where a lit arc leaves them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from foreign_disk import foreign_disk, lambert, lommel_seeliger

from catalog.basemap import BaseMap
from catalog.pose import Pose
from lab.simulate.small_world import EUROPA, PEAK_DN, SKY_DN, observed, scene_of, small_camera, true_pose
from tasks.joint import JointSettings
from tasks.joint.coarse_to_fine import Estimate, estimated, prior_sigmas
from tasks.joint.parameters import OFFSET, RANGE, State, difference
from tasks.joint.problem import Problem
from tasks.joint.relief_response import ARCS, relief_response
from tasks.range.limb import LimbRangeSettings, find_range_by_limb
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

SETTINGS = JointSettings(second_start=False, oversample=3, hold=("attitude",), plain=())
SIGMAS = prior_sigmas(SETTINGS.priors.file, 1.5e5)
SIZE = (140, 140)
CAMERA = small_camera(100.0, SIZE).model_copy(update={"centre_px": (69.5, 69.5)})
SPHERE = EUROPA.model_copy(update={"radii_km": (1560.8,) * 3, "radius_sigma_km": 0.0, "relief_km": 0.0})
GREY = BaseMap("grey", np.ones((32, 64), np.float32), 0.0, "grey")
RISE_PX = 0.05
ARC_DEG = (180.0, 200.0)


def scene() -> Scene:
    return replace(scene_of(CAMERA, "mixture", GREY), target=SPHERE)


def picture(pose: Pose, arc_px: float = 0.0, law=lambert) -> np.ndarray:
    """The sphere of `pose`, with one arc of its limb higher by arc_px."""
    sun = pose.camera_from_j2000 @ pose.sun_from_target_km

    def relief(angle: np.ndarray) -> np.ndarray:
        return np.where((angle >= ARC_DEG[0]) & (angle < ARC_DEG[1]), arc_px, 0.0)

    centre = CAMERA.project(pose.target_in_camera_km)
    radius = disk_radius_px(pose, CAMERA, SPHERE)
    bright = foreign_disk(SIZE, centre, radius, sun / np.linalg.norm(sun), 0.8, law, relief)
    return SKY_DN + PEAK_DN * bright


@cache
def solved(phase_deg: float, arc_px: float = 0.0, law=lambert) -> tuple[Estimate, Pose]:
    truth = true_pose(CAMERA, phase_deg=phase_deg, sun_azimuth_deg=185.0)
    start = State(truth, 0.8)
    seen = observed(picture(truth, arc_px, law), 0.5)
    return estimated(Problem(seen, scene(), start, SIGMAS, SETTINGS), start), truth


@pytest.mark.parametrize("phase_deg", [30.0, 80.0])
def test_an_arc_that_lies_higher_moves_the_solution_as_predicted(phase_deg: float) -> None:
    # A small rise: a large one would be taken for an outlier, and move the solution less.
    (level, _), (raised, _) = solved(phase_deg), solved(phase_deg, RISE_PX)
    moved = difference(raised.free_state, level.free_state, CAMERA)
    predicted = RISE_PX * relief_response(level.free)[:, int(ARC_DEG[0] // 20)]
    print(f"\nmoved {np.round(moved[OFFSET], 4)} px, range {moved[RANGE]:+.5f}; foretold {predicted[:3]}")
    weight = np.array([1.0, 1.0, 50.0])
    step, expected = moved[:3] * weight, predicted[:3] * weight
    share = step @ expected / (expected @ expected)
    print(f"by {share:.2f} of it; otherwise by {np.linalg.norm(step - share * expected):.4f} px")
    assert np.hypot(*predicted[OFFSET]) > 0.2 * RISE_PX
    # Tiles and trust, which learn of it, take a part.
    assert 0.4 < share < 1.2
    assert np.linalg.norm(step - share * expected) < 0.2 * np.linalg.norm(expected)


def test_a_limb_that_is_higher_all_round_is_a_nearer_body() -> None:
    estimate, truth = solved(30.0)
    together = relief_response(estimate.free)[:, :ARCS].sum(axis=1)
    radius = disk_radius_px(truth, CAMERA, SPHERE)
    assert together[RANGE] * radius == pytest.approx(-1, abs=0.15)
    assert np.hypot(*together[OFFSET]) < 0.15


def test_relief_is_an_error_of_centre_and_range_along_what_a_half_lit_limb_leaves_open() -> None:
    estimate, truth = solved(80.0)
    rough = SPHERE.model_copy(update={"relief_km": 0.01 * SPHERE.mean_radius_km})
    seen = observed(picture(truth), 0.5)
    state = State(truth, 0.8)
    other = estimated(Problem(seen, replace(scene(), target=rough), state, SIGMAS, SETTINGS), state)
    added = other.free_covariance - estimate.free_covariance
    correlation = added[0, RANGE] / np.sqrt(added[0, 0] * added[RANGE, RANGE])
    print(f"\nrelief of 0.5 px adds {np.sqrt(np.diag(added)[:3])}, correlation of x and range {correlation:.2f}")
    # The Sun is at the left: a disk that is farther, hence smaller, and more to the left has the same lit limb.
    assert correlation < -0.7
    assert np.sqrt(added[0, 0]) > 1.5 * np.sqrt(added[1, 1])


@pytest.mark.parametrize("law", [lambert, lommel_seeliger])
def test_the_limb_alone_tells_the_correlation_of_centre_and_range(law) -> None:
    truth = true_pose(CAMERA, phase_deg=80.0, sun_azimuth_deg=185.0)
    edges_alone = LimbRangeSettings(centre_px=0, radius_px=0)
    found = find_range_by_limb(observed(picture(truth, law=law), 0.5), truth, scene(), edges_alone)
    covariance = np.array(found.evidence["covariance"])
    sigma = np.sqrt(np.diag(covariance))
    assert found.uncertainty["offset_px"] == pytest.approx(sigma[:2])
    assert found.uncertainty["range_factor"] == pytest.approx(sigma[2])
    error = difference(State(found.pose, 1.0), State(truth, 1.0), CAMERA)[:3]
    print(f"\nerror {error}, sigma {sigma}, weighted square {error @ np.linalg.solve(covariance, error):.2f}")
    assert covariance[0, 2] / (sigma[0] * sigma[2]) < -0.7
    assert error @ np.linalg.solve(covariance, error) < 16.3  # 0.1 % of three unknowns
