"""What relief does to markings: those of a higher surface lie farther from the middle of the disk."""

import numpy as np
import pytest

from lab.simulate.small_world import small_camera, true_pose
from tasks.joint.parameters import ATTITUDE, State
from tasks.joint.relief_response import FIRST, MOST_EMISSION_DEG, RING_DEG, SECTORS, raising_turn

CAMERA = small_camera(90.0, (124, 124)).model_copy(update={"centre_px": (61.5, 61.5)})
RADIUS_PX = 45.0


@pytest.mark.parametrize("phase_deg", [20.0, 110.0])
@pytest.mark.parametrize("emission_deg", [5.0, 30.0, 60.0, 75.0])
@pytest.mark.parametrize("position_deg", [0.0, 80.0, 200.0, 310.0])
def test_the_turn_moves_a_place_outward_by_the_sine_of_its_emission_angle(
    phase_deg: float, emission_deg: float, position_deg: float
) -> None:
    pose, e, angle = true_pose(CAMERA, phase_deg=phase_deg), np.radians(emission_deg), np.radians(position_deg)
    outward = np.array([np.cos(angle), np.sin(angle)])
    found_deg, turn_deg = raising_turn((RADIUS_PX * np.sin(e) * outward)[None], RADIUS_PX, pose.camera_from_body)
    assert found_deg == pytest.approx([emission_deg])
    # The point of the surface that is seen there, and where it is when the body is turned.
    radius_km = RADIUS_PX / CAMERA.focal_length_px * pose.range_km
    in_camera = radius_km * np.array([*(np.sin(e) * outward), -np.cos(e)])
    step = np.zeros(8)
    step[ATTITUDE] = turn_deg[0] / 10
    turned = State(pose, 1.0).moved(step, CAMERA).pose
    moved_km = turned.camera_from_body @ (pose.camera_from_body.T @ in_camera) - in_camera
    moved_px = 10 * moved_km[:2] / radius_km * RADIUS_PX
    assert moved_px @ outward == pytest.approx(np.sin(e), abs=0.04)
    assert moved_px @ [-outward[1], outward[0]] == pytest.approx(0, abs=0.02)


def test_places_at_the_limb_move_no_farther_than_the_blur_shows() -> None:
    emission_deg, turn_deg = raising_turn(np.array([[RADIUS_PX, 0.0], [2 * RADIUS_PX, 1.0]]), RADIUS_PX, np.eye(3))
    assert emission_deg == pytest.approx([MOST_EMISSION_DEG] * 2)
    assert np.isfinite(turn_deg).all()


def test_patches_are_about_as_wide_as_arcs_of_the_limb() -> None:
    rings = np.array([*RING_DEG, 90.0])
    middles = (np.concatenate([[0.0], RING_DEG]) + rings) / 2
    widths_deg = 360 * np.sin(np.radians(middles)) / SECTORS
    assert FIRST[-1] == SECTORS.sum()
    assert widths_deg.min() > 12
    assert widths_deg.max() < 30
