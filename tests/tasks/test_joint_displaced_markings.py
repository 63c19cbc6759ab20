"""A distortion that no file tells of: limb and markings show it, and the stated errors hold what it does."""

import cv2
import numpy as np
import pytest

from lab.simulate.plant import pose_error
from lab.simulate.small_world import clean_image, observed, scene_of, small_camera, true_pose
from tasks.joint import JointSettings, find_pose_jointly
from tasks.joint.contradiction import size_of
from tasks.joint.displaced_markings import terms
from tasks.joint.problem import DistortionError

ONCE = JointSettings(second_start=False)
RADIUS_PX, SIDE = 60.0, 170


def bent(picture: np.ndarray, rms_px: float, strengths: dict[int, float], still: float = np.inf) -> np.ndarray:
    """The picture displaced by a smooth field about its middle, `rms_px` over the disk: terms by their number. From
    `still` radii on nothing moves, as under a map whose places are off."""
    y, x = np.indices(picture.shape, np.float32)
    u, v = (x - SIDE / 2) / RADIUS_PX, (y - SIDE / 2) / RADIUS_PX
    known = terms(u, v)
    field = sum(strength * np.stack(known[number]) for number, strength in strengths.items())
    inside = np.hypot(u, v) < 1
    size = np.sqrt(((field[:, inside] - field[:, inside].mean(axis=1, keepdims=True)) ** 2).sum(axis=0).mean())
    moving = 1.0 if np.isinf(still) else np.clip((still - np.hypot(u, v)) / 0.2, 0, 1)
    dx, dy = (rms_px / size * field * moving).astype(np.float32)
    return cv2.remap(picture.astype(np.float32), x - dx, y - dy, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


@pytest.mark.parametrize(
    ("rms_px", "strengths"),
    [
        (0.0, {4: 1.0}),
        (0.4, {5: 0.5, 8: 0.5, 9: 0.5}),
        (0.3, {0: 1.0, 2: -0.8, 3: 0.6}),  # a scale, which looks like another range, and shear
    ],
)
def test_a_distortion_is_shown_and_is_in_the_errors(rms_px: float, strengths: dict[int, float]) -> None:
    camera = small_camera(2 * RADIUS_PX, (SIDE, SIDE)).model_copy(update={"centre_px": (SIDE / 2, SIDE / 2)})
    scene, truth = scene_of(camera, photometry="mixture"), true_pose(camera, phase_deg=50)
    seen = observed(bent(clean_image(scene, truth), rms_px, strengths))
    found = find_pose_jointly(seen, truth, truth, "file", scene, ONCE)
    reported = found.evidence["displacement"]
    error = pose_error(found.pose, truth, scene.camera, scene.target)
    sigma, range_sigma = np.array(found.uncertainty["offset_px"]), found.uncertainty["range_factor"]
    print(f"\n{reported}\ncentre {error.centre_px}, {sigma}; range {error.range}, {range_sigma}")
    assert (reported["size_px"] > 0.05) == (rms_px > 0)
    assert (np.abs(error.centre_px) < 3 * sigma).all()
    assert abs(error.range) < 3 * range_sigma
    if rms_px == 0:
        assert reported["size_px"] == 0
        assert (sigma < 0.03).all()


def test_markings_that_are_displaced_without_the_limb_are_the_maps_errors() -> None:
    camera = small_camera(2 * RADIUS_PX, (SIDE, SIDE)).model_copy(update={"centre_px": (SIDE / 2, SIDE / 2)})
    scene, truth = scene_of(camera, photometry="mixture"), true_pose(camera, phase_deg=20)
    picture, sizes = clean_image(scene, truth), {}
    for still in (0.95, np.inf):
        seen = observed(bent(picture, 0.4, {5: 0.5, 8: 0.5, 9: 0.5}, still))
        found = find_pose_jointly(seen, truth, truth, "file", scene, ONCE)
        sizes[still] = found.evidence["displacement"]["size_px"]
    print(f"\n{sizes}")
    assert sizes[0.95] < 0.5 * sizes[np.inf]


def test_a_camera_that_knows_its_distortion_is_not_tried() -> None:
    camera = small_camera(2 * RADIUS_PX, (SIDE, SIDE)).model_copy(update={"centre_px": (SIDE / 2, SIDE / 2)})
    scene, truth = scene_of(camera, photometry="mixture"), true_pose(camera, phase_deg=50)
    seen = observed(clean_image(scene, truth))
    known = find_pose_jointly(seen, truth, truth, "file", scene, ONCE, distortion=DistortionError(0.3))
    assert known.evidence["displacement"] is None


def test_the_size_of_terms_is_found_beyond_their_noise() -> None:
    random = np.random.default_rng(3)
    noise, passed = np.linspace(0.002, 0.02, 8), np.linspace(0.5, 1.0, 8)
    sizes = [
        size_of(random.normal(size=8) * np.sqrt(noise + passed * true**2), noise, passed, 0.3, 2.0)
        for true in np.repeat([0.0, 0.2], 400)
    ]
    assert np.mean(np.array(sizes[:400]) > 0) < 0.06
    assert np.mean(np.array(sizes[400:]) > 0) > 0.8
    found = [size for size in sizes[400:] if size]
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(0.2, rel=0.15)


def test_terms_of_second_order_move_no_disk_as_a_whole() -> None:
    v, u = np.mgrid[-1:1:401j, -1:1:401j]
    inside = np.hypot(u, v) < 1
    means = [[float(np.mean(part[inside])) for part in term] for term in terms(u, v)]
    assert np.abs(means).max() < 2e-3
