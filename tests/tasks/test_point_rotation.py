"""From an offset in the image to a turn of the camera: exact, without roll, and with the paper's signs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from tasks.joint.parameters import State, difference
from tasks.point.rotation import angles_from_offset, euler_rotation, pose_facing, pose_moved_by, pose_pointed_at

CAMERA = Camera(name="test", size_px=(1000, 800), centre_px=(480.0, 410.0), focal_length_px=17000)
OFFSETS = st.tuples(st.floats(-800, 800), st.floats(-800, 800))
PLACES = st.tuples(st.floats(-900, 1900), st.floats(-900, 1700))
VECTORS = st.tuples(*[st.floats(-170.0, 170.0)] * 3)
FOCAL_LENGTHS = st.floats(10_000, 300_000)


def pose_with_target_at(
    camera: Camera, place_px: tuple[float, float], turned_deg: tuple[float, ...] = (0, 0, 0)
) -> Pose:
    camera_from_j2000 = rotation_from_vector_deg(turned_deg)
    target = camera_from_j2000.T @ camera.ray(place_px) * 8e5
    return Pose(0.0, camera_from_j2000, target, np.array([1e8, 2e8, 3e8]), np.eye(3))


def centre_px(pose: Pose, camera: Camera) -> np.ndarray:
    return camera.project(pose.target_in_camera_km)


@settings(max_examples=100, deadline=None)
@given(PLACES, OFFSETS, VECTORS, FOCAL_LENGTHS)
def test_the_projected_centre_moves_by_exactly_the_offset(place, offset, turned, focal_px) -> None:
    camera = CAMERA.model_copy(update={"focal_length_px": focal_px})
    pose = pose_with_target_at(camera, place, turned)
    moved = pose_moved_by(pose, camera, offset)
    assert centre_px(moved, camera) - centre_px(pose, camera) == pytest.approx(offset, abs=1e-6)
    assert moved.range_km == pose.range_km
    np.testing.assert_array_equal(moved.body_from_j2000, pose.body_from_j2000)


@settings(max_examples=100, deadline=None)
@given(PLACES, OFFSETS, VECTORS)
def test_the_turn_has_no_roll(place, offset, turned) -> None:
    pose = pose_with_target_at(CAMERA, place, turned)
    turn = pose_moved_by(pose, CAMERA, offset).camera_from_j2000 @ pose.camera_from_j2000.T
    roll_deg = np.degrees(np.arctan2(turn[1, 0], turn[1, 1]))
    assert roll_deg == pytest.approx(0, abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(PLACES, OFFSETS, VECTORS)
def test_the_inverse_offset_leads_back(place, offset, turned) -> None:
    pose = pose_with_target_at(CAMERA, place, turned)
    back = pose_moved_by(pose_moved_by(pose, CAMERA, offset), CAMERA, -np.array(offset))
    assert centre_px(back, CAMERA) == pytest.approx(centre_px(pose, CAMERA), abs=1e-6)
    # Turns about two axes do not commute: what is left is a roll of second order in the angles, no more.
    left_rad = np.linalg.norm(back.camera_from_j2000 @ pose.camera_from_j2000.T - np.eye(3)) / np.sqrt(2)
    length, off_axis = np.hypot(*offset), np.hypot(*np.subtract(place, CAMERA.centre_px))
    assert left_rad <= length * (length + off_axis) / CAMERA.focal_length_px**2 + 1e-9


def test_the_angles_have_the_papers_signs() -> None:
    alpha, beta = angles_from_offset(CAMERA, (170.0, 85.0))
    assert beta == pytest.approx(np.arctan(170 / 17000))  # arctan(b_x / b_z): to the right
    assert alpha == pytest.approx(np.arctan(-85 / 17000))  # arctan(-b_y / b_z): down is negative
    turned_boresight = euler_rotation(alpha, beta) @ [0, 0, 1]
    assert CAMERA.project(turned_boresight) == pytest.approx((480 + 170, 410 + 85), abs=0.01)


def test_the_papers_angles_move_a_target_on_the_boresight_by_the_offset() -> None:
    pose = pose_with_target_at(CAMERA, CAMERA.centre_px)
    matrix = euler_rotation(*angles_from_offset(CAMERA, (20.32, -30.46)))
    turned = pose.replaced(camera_from_j2000=matrix @ pose.camera_from_j2000)
    assert centre_px(turned, CAMERA) - CAMERA.centre_px == pytest.approx((20.32, -30.46), abs=1e-3)


def test_a_target_behind_the_camera_cannot_be_moved() -> None:
    behind = Pose(0.0, np.eye(3), np.array([10.0, 0, -8e5]), np.array([1e8, 0, 0]), np.eye(3))
    with pytest.raises(ValueError, match="behind the camera"):
        pose_moved_by(behind, CAMERA, (1.0, 2.0))
    with pytest.raises(ValueError, match="not finite"):
        pose_moved_by(pose_with_target_at(CAMERA, (500, 400)), CAMERA, (np.nan, 2.0))


@settings(max_examples=150, deadline=None)
@given(PLACES, VECTORS, VECTORS)
def test_pointing_at_a_pixel_puts_the_target_there_from_anywhere(place, turned, elsewhere) -> None:
    pose = pose_with_target_at(CAMERA, (500, 400), turned)
    lost = pose.replaced(camera_from_j2000=rotation_from_vector_deg(elsewhere) @ pose.camera_from_j2000)
    found = pose_pointed_at(lost, CAMERA, place)
    assert centre_px(found, CAMERA) == pytest.approx(place, abs=1e-6)
    turn = found.camera_from_j2000 @ lost.camera_from_j2000.T
    # The smallest rotation: its angle is the one between the directions.
    cosine = CAMERA.ray(place) @ lost.target_in_camera_km / lost.range_km
    assert (np.trace(turn) - 1) / 2 == pytest.approx(cosine, abs=1e-9)


@pytest.mark.parametrize("miss_rad", [0.0, 1e-12, 1e-9, 1e-8, 1e-6, 1e-3])
def test_pointing_at_a_pixel_works_from_exactly_and_nearly_the_opposite_direction(miss_rad: float) -> None:
    """1 + cosine, by which a common formula divides, is lost to rounding there."""
    place = (333.0, 444.0)
    target = -CAMERA.ray(place) + miss_rad * np.array([0.6, -0.8, 0])
    behind = Pose(0.0, np.eye(3), target / np.linalg.norm(target) * 8e5, np.array([1e8, 0, 0]), np.eye(3))
    assert centre_px(pose_pointed_at(behind, CAMERA, place), CAMERA) == pytest.approx(place, abs=1e-6)


@settings(max_examples=100, deadline=None)
@given(
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1),
    st.one_of(st.floats(0, 180), st.sampled_from([89.999999999, 90.0, 90.000000001, 180.0])),
)
def test_whichever_way_the_predicted_camera_looks_the_step_from_it_is_finite(
    axis: tuple[float, ...], off_deg: float
) -> None:
    found = pose_with_target_at(CAMERA, (400.0, 500.0))
    turn = rotation_from_vector_deg(off_deg * np.array(axis) / np.linalg.norm(axis))
    predicted = found.replaced(camera_from_j2000=turn @ found.camera_from_j2000)
    facing = pose_facing(predicted, found, CAMERA)
    step = difference(State(found, 1.0), State(facing, 1.0), CAMERA)
    assert np.isfinite(step).all()
    if facing is not predicted:
        np.testing.assert_allclose(step[:2], 0, atol=1e-5)
