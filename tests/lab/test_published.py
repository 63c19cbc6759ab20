"""Published poses against kernels: planted differences come back with their signs."""

from pathlib import Path

import numpy as np
import pytest

from catalog.pose import PartialPose, Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from lab.paper import published_geometry as published
from lab.paper.published_geometry import PublishedDifference, neighbours, one_image_sigma
from lab.simulate.europa57 import PaperImage, paper_images

KNOWN = paper_images()["LOR_0034930319"]


def difference(pose: Pose, spice: Pose, factor: float = 1.0, image: str = "made") -> PublishedDifference:
    parts = PartialPose(spice.et, spice.camera_from_j2000, spice.target_from_spacecraft_km, None, spice.body_from_j2000)
    paper_image = PaperImage(image, KNOWN.camera, 0.01, factor, pose)
    return published._difference(paper_image, parts, (), find_target("europa"))


def turned_in_camera(pose: Pose, vector_deg: list[float]) -> Pose:
    """The body turned by a rotation vector in the camera's axes."""
    in_j2000 = pose.camera_from_j2000.T @ rotation_from_vector_deg(vector_deg) @ pose.camera_from_j2000
    return pose.replaced(body_from_j2000=pose.body_from_j2000 @ in_j2000.T)


def test_the_same_pose_differs_in_nothing() -> None:
    found = difference(KNOWN.pose, KNOWN.pose)
    assert found.range_factor == pytest.approx(1)
    assert found.direction_px == pytest.approx((0, 0), abs=1e-6)
    assert found.turn_angle_deg == pytest.approx(0, abs=1e-9)
    assert found.pointing_px == pytest.approx((0, 0), abs=1e-6)
    assert not found.turned


def test_a_planted_turn_comes_back_in_the_cameras_axes() -> None:
    found = difference(turned_in_camera(KNOWN.pose, [0.4, -0.7, 0.2]), KNOWN.pose)
    assert found.turn_deg == pytest.approx([0.4, -0.7, 0.2], abs=1e-9)
    assert found.turn_px == pytest.approx(np.radians(np.hypot(0.4, 0.7)) * found.radius_px)
    assert found.turned


def test_a_turn_about_the_pole_moves_the_markings_east() -> None:
    east = rotation_from_vector_deg([0, 0, 0.6])  # of the body, about its own pole
    found = difference(KNOWN.pose.replaced(body_from_j2000=east.T @ KNOWN.pose.body_from_j2000), KNOWN.pose)
    assert found.turn_in_body_deg == pytest.approx([0, 0, 0.6], abs=1e-9)
    before, after = (pose.camera_from_body @ [1.0, 0, 0] for pose in (KNOWN.pose, found.image.pose))
    eastward = KNOWN.pose.camera_from_body @ [0, 1.0, 0]
    assert (after - before) @ eastward == pytest.approx(np.sin(np.radians(0.6)))


def test_the_middle_of_the_disk_and_the_side_of_the_sun() -> None:
    pose = KNOWN.pose.replaced(
        body_from_j2000=np.eye(3), target_from_spacecraft_km=[0, -3e6, 0], sun_from_target_km=[7e8, 1e8, 0]
    )
    found = difference(pose, pose)
    assert found.sub_spacecraft_deg == pytest.approx((0, 90))
    assert not found.sun_in_east  # at longitude 8, seen from longitude 90
    assert difference(pose.replaced(sun_from_target_km=[-7e8, 1e8, 0]), pose).sun_in_east


def test_the_range_factor_is_the_published_range_over_spices_with_and_without_kdist() -> None:
    found = difference(KNOWN.pose.with_range_factor(0.99), KNOWN.pose, factor=0.99)
    assert (found.range_factor, found.range_factor_before) == pytest.approx((0.99, 1.0))


def test_neighbours_are_consecutive_images_of_one_camera_within_minutes() -> None:
    later = [KNOWN.pose.replaced(et=KNOWN.pose.et + seconds) for seconds in (0.0, 3.0, 2000.0)]
    found = [
        difference(turned_in_camera(pose, [0.3 * i, 0, 0]), pose, 1.0 + i / 100, f"image{i}")
        for i, pose in enumerate(later)
    ]
    (pair,) = neighbours(found[::-1])
    assert (pair.first.image.image, pair.second.image.image, pair.seconds) == ("image0", "image1", 3.0)
    assert pair.angle_deg == pytest.approx(0.3)
    assert pair.range_factor == pytest.approx(0.01)
    assert pair.surface_px == pytest.approx(np.radians(0.3) * found[0].radius_px)
    assert len(neighbours(found, within_s=1e4)) == 2


def test_the_error_of_one_image_follows_from_the_differences_of_pairs() -> None:
    rng = np.random.default_rng(1)
    errors = rng.normal(0, 0.2, (4000, 2))
    assert one_image_sigma((errors[:, 0] - errors[:, 1]).tolist()) == pytest.approx(0.2, rel=0.05)
    assert one_image_sigma([]) is None


def test_without_kernels_nothing_is_compared_and_everything_is_said(tmp_path: Path) -> None:
    (found,) = published.published_differences([KNOWN], [])
    assert (found.range_factor, found.turn_deg, found.pointing_px) == (None, None, None)
    assert found.missing
    assert neighbours([found, found]) == []
