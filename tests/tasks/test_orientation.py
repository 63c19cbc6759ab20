"""Whether the image confirms an orientation: by its markings, against its mirror images, and by the dark limb."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from catalog.basemap import uniform_map
from catalog.flips import MEANINGS, PLACES, Flip, flipped
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target, find_target
from lab.simulate.small_world import clean_image, observation_of, observed, scene_of, small_camera, true_pose
from tasks.attitude.markings import markings_at_pose, mismatch_of
from tasks.attitude.symmetry import better_flip, doubt_of_symmetry
from tasks.joint.outline import outline_spread
from tasks.joint.parameters import OFFSET, RANGE
from tasks.simulate import Scene
from tasks.validate.dark_limb import dark_limb, doubt_of_dark_limb

PRIOR_DEG = 3.0


def small(radius_px: float, phase_deg: float) -> tuple[Scene, Pose]:
    """A scene of Europa of that radius in the middle of its frame, and the true pose."""
    side = int(2.5 * radius_px + 40)
    camera = small_camera(2 * radius_px, (side, side)).model_copy(update={"centre_px": (side / 2, side / 2)})
    return scene_of(camera, photometry="mixture"), true_pose(camera, phase_deg=phase_deg)


def turned(pose: Pose, vector_deg: list[float]) -> Pose:
    """The pose with the body turned in its own frame."""
    return pose.replaced(body_from_j2000=rotation_from_vector_deg(vector_deg).T @ pose.body_from_j2000)


@pytest.mark.parametrize(("radius_px", "phase_deg"), [(20, 40), (40, 90), (60, 140)])
def test_markings_match_where_they_are_and_nowhere_else(radius_px: float, phase_deg: float) -> None:
    scene, truth = small(radius_px, phase_deg)
    observation = observation_of(scene, truth)
    here = markings_at_pose(observation, truth, scene, PRIOR_DEG)
    print("truth", here.to_dict())
    assert here.verdict == "matched"
    for wrong in ([12.0, -10.0, 6.0], [25.0, 10.0, -20.0], [0.0, 90.0, 0.0], [0.0, 0.0, 180.0]):
        there = markings_at_pose(observation, turned(truth, wrong), scene, PRIOR_DEG)
        print(wrong, there.to_dict())
        assert there.verdict != "matched"
        assert (there.sigmas or 0) < (here.sigmas or 0)


def test_a_better_orientation_within_the_prior_is_found() -> None:
    scene, truth = small(40, 60)
    planted = np.array([6.0, -5.0, 4.0])
    found = markings_at_pose(observation_of(scene, truth), turned(truth, list(planted)), scene, PRIOR_DEG)
    print(found.to_dict())
    assert found.verdict == "mismatched"
    assert found.better_deg is not None
    assert np.linalg.norm(found.better_deg + planted) < 1.5
    assert "turned by" in mismatch_of(found)


@pytest.mark.parametrize("noise_dn", [400.0, 2000.0])
def test_what_noise_hides_is_undetermined(noise_dn: float) -> None:
    scene, truth = small(15, 60)
    for pose in (truth, turned(truth, [0.0, 0.0, 180.0])):
        assert (
            markings_at_pose(observation_of(scene, truth, noise_dn), pose, scene, PRIOR_DEG).verdict == "undetermined"
        )


def test_a_body_without_the_maps_markings_is_no_match() -> None:
    scene, truth = small(30, 50)
    bland = observation_of(replace(scene, basemap=uniform_map()), truth)
    assert markings_at_pose(bland, truth, scene, PRIOR_DEG).verdict == "mismatched"
    assert markings_at_pose(bland, truth, replace(scene, basemap=uniform_map()), PRIOR_DEG).verdict == "no-map"


@pytest.mark.parametrize("contrast", [1.0, 4.0])
def test_another_bodys_markings_are_no_match_however_strong_they_are(contrast: float) -> None:
    scene, truth = small(45, 60)
    own = scene.basemap.albedo
    other = np.clip(1 + contrast * (np.roll(own[::-1], own.shape[1] // 3, axis=1) - 1), 0.05, None)
    seen = observation_of(replace(scene, basemap=replace(scene.basemap, albedo=other.astype(np.float32))), truth)
    found = markings_at_pose(seen, truth, scene, PRIOR_DEG)
    print(contrast, found.to_dict())
    assert found.verdict == "mismatched"


@pytest.mark.parametrize("radius_px", [12, 30])
def test_the_maps_markings_at_half_their_contrast_are_not_called_absent(radius_px: float) -> None:
    scene, truth = small(radius_px, 60)
    weak = replace(scene.basemap, albedo=(0.5 + 0.5 * scene.basemap.albedo).astype(np.float32))
    found = markings_at_pose(observation_of(replace(scene, basemap=weak), truth, 3.0), truth, scene, PRIOR_DEG)
    print(radius_px, found.to_dict())
    assert found.verdict in ("matched", "undetermined")


@pytest.mark.parametrize("flip", list(PLACES))
def test_a_flip_takes_pixels_where_it_says(flip: Flip) -> None:
    side = 9
    plane = np.zeros((side, side))
    plane[2, 7] = 1
    y, x = np.argwhere(flipped(plane, flip))[0]
    middle = (side - 1) / 2
    assert np.allclose((x - middle, y - middle), PLACES[flip] @ (7 - middle, 2 - middle))
    assert flipped(np.zeros((3, 5)), flip).shape == ((3, 5) if flip in ("x", "y", "rot180") else (5, 3))


@pytest.mark.parametrize("flip", ["x", "rot180", "transpose"])
def test_a_flipped_picture_is_found_out_where_its_shading_does_not_tell(flip: Flip) -> None:
    scene, _ = small(25, 4)
    side = scene.camera.size_px[0]
    truth = true_pose(scene.camera, centre_px=((side - 1) / 2, (side - 1) / 2), phase_deg=4)
    picture = clean_image(scene, truth)
    found = symmetry_of(observed(flipped(picture, flip)), truth, scene)
    assert found is not None
    undone = flipped(flipped(picture, flip), found)
    assert np.array_equal(undone, picture)
    assert symmetry_of(observed(picture), truth, scene) is None


def symmetry_of(observation: Observation, pose: Pose, scene: Scene) -> Flip | None:
    """The flip that fits better, its doubt checked."""
    markings = markings_at_pose(observation, pose, scene, PRIOR_DEG)
    found = better_flip(observation, pose, scene, markings, PRIOR_DEG)
    if found is None:
        return None
    assert f"--flip {found.flip}" in doubt_of_symmetry(found)
    assert MEANINGS[found.flip] in doubt_of_symmetry(found)
    return found.flip


def planet_lit(scene: Scene, pose: Pose, factor: float, level: float) -> NDArray[np.float64]:
    """The picture with a faint dark side on a disk `factor` times as large as the body's."""
    camera = scene.camera
    y, x = np.mgrid[0 : camera.size_px[1], 0 : camera.size_px[0]]
    centre = camera.project(pose.target_in_camera_km)
    radius = camera.focal_length_px * scene.target.mean_radius_km / pose.range_km
    inside = np.clip(factor * radius - np.hypot(x - centre[0], y - centre[1]) + 0.5, 0, 1)
    return np.asarray(clean_image(scene, pose) + level * inside, np.float64)


@pytest.mark.parametrize(("factor", "is_fault"), [(1.0, False), (1.06, True), (1.12, True), (0.97, False)])
def test_a_planet_lit_limb_outside_the_models_is_a_fault(factor: float, is_fault: bool) -> None:
    scene, pose = small(60, 120)
    found = dark_limb(observed(planet_lit(scene, pose, factor, 8.0)), pose, scene)
    print(factor, found)
    assert found.dark >= 6
    assert found.is_fault == is_fault
    assert (doubt_of_dark_limb(found) is not None) == is_fault


def test_scattered_light_is_no_limb() -> None:
    import cv2

    scene, pose = small(60, 120)
    image = clean_image(scene, pose)
    haze = image + sum(0.05 * cv2.GaussianBlur(image, (0, 0), width) for width in (6.0, 20.0))
    assert not dark_limb(observed(haze), pose, scene).is_fault


def test_an_unknown_orientation_of_a_sphere_moves_nothing_and_of_a_flat_body_much() -> None:
    scene, pose = small(60, 60)
    ball = Target(name="ball", naif_id=1, radii_km=(1560.0, 1560.0, 1560.0), body_frame="J2000")
    flat = find_target("saturn").model_copy(update={"radii_km": (1560.0, 1560.0, 1400.0)})
    spread = {
        name: outline_spread(pose, replace(scene, target=t), 30.0, 8) for name, t in {"b": ball, "f": flat}.items()
    }
    few = outline_spread(pose, replace(scene, target=flat), 3.0, 8)
    print({name: np.sqrt(np.diag(s))[:3] for name, s in spread.items()}, np.sqrt(np.diag(few))[:3])
    assert np.abs(spread["b"]).max() < 1e-6
    assert spread["f"][RANGE, RANGE] ** 0.5 > 0.01
    assert few[RANGE, RANGE] < spread["f"][RANGE, RANGE]
    assert np.trace(spread["f"][OFFSET, OFFSET]) ** 0.5 > 0.3
