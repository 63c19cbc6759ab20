"""What a disk tells of the beam's bending: planted strengths, what is left alone, what the step leaves for others."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from catalog.basemap import packaged_map_path
from catalog.digest import sha256_of_file
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from lab.simulate.plant import pose_error
from lab.simulate.small_world import observation_of, scene_of, small_camera, true_pose
from tasks.joint import JointSettings, find_pose_jointly
from tasks.joint.problem import DistortionError
from tasks.joint.step import JointInputs, Known, known_after, run
from tasks.scene_inputs import BaseMapInputs, SceneFiles, SceneInputs
from tasks.simulate import Scene
from tasks.stored import load_arrays, load_observation, save_arrays, save_observation
from tasks.undistort.bending import bending_field
from tasks.undistort.resample import displaced
from tasks.undistort.step import DISTORTION
from tasks.work import Work

ONCE = JointSettings(second_start=False)
# Of the coefficient, px per DN: a frame whose marks all but one are far from the disk.
SPREAD_PX_PER_DN = 0.008

World = tuple[Scene, Pose, Observation, NDArray[np.float32]]


@pytest.fixture(scope="module")
def world() -> World:
    """A disk as it is, and by how much an error of its bending of 1-sigma would move its pixels."""
    camera = small_camera(110.0, (160, 160)).model_copy(update={"centre_px": (79.5, 79.5)})
    scene, truth = scene_of(camera), true_pose(camera)
    seen = observation_of(scene, truth)
    return scene, truth, seen, bending_field(seen, 255.0).planes * np.float32(SPREAD_PX_PER_DN)


@pytest.mark.parametrize("strength", [-1.5, 1.5])
def test_a_planted_strength_is_found_and_centre_and_range_are_right_again(world: World, strength: float) -> None:
    scene, truth, seen, planes = world
    bent = displaced(seen, -strength * planes)
    solve = partial(
        find_pose_jointly, bent, truth, truth, "file", scene, distortion=DistortionError(0.0, planes.astype(np.float16))
    )
    without, found = solve(ONCE.model_copy(update={"bending_px": None})), solve(ONCE)
    bending = found.evidence["bending"]
    before, after = (pose_error(c.pose, truth, scene.camera, scene.target) for c in (without, found))
    print(
        f"planted {strength}, found {bending}; centre {before.centre_px} -> {after.centre_px}, range {before.range:.5f}"
    )
    print(f"  -> {after.range:.5f}")
    assert without.evidence["bending"] is None
    assert bending["strength"] == pytest.approx(strength, abs=3 * bending["sigma"])
    assert bending["sigma"] < 0.5
    assert np.hypot(*after.centre_px) < 0.5 * np.hypot(*before.centre_px)
    assert found.uncertainty["offset_px"][1] < 0.7 * without.uncertainty["offset_px"][1]
    assert (np.abs(after.centre_px) < 3 * np.array(found.uncertainty["offset_px"])).all()


def test_a_disk_that_shows_no_other_bending_is_left_alone(world: World) -> None:
    scene, truth, seen, planes = world
    exact = DistortionError(0.0, 0.1 * planes)
    assert find_pose_jointly(seen, truth, truth, "file", scene, ONCE, distortion=exact).evidence["bending"] is None


def test_a_strength_is_the_same_at_reduced_resolution(world: World) -> None:
    scene, truth, seen, planes = world
    bent = displaced(seen, -1.5 * planes)  # by +1.5: pixels are taken from the other side
    third = ONCE.model_copy(update={"diameter_px": 40.0, "first_diameter_px": 40.0})
    found = find_pose_jointly(bent, truth, truth, "file", scene, third, distortion=DistortionError(0.0, planes))
    bending = found.evidence["bending"]
    full = find_pose_jointly(bent, truth, truth, "file", scene, ONCE, distortion=DistortionError(0.0, planes))
    whole = full.evidence["bending"]
    print(f"planted 1.5, found {whole}; at a third of the resolution {bending}")
    assert bending["strength"] == pytest.approx(whole["strength"], abs=0.5 * bending["sigma"])
    assert bending["moved_px"] / bending["strength"] == pytest.approx(whole["moved_px"] / whole["strength"], rel=0.05)


def test_a_range_held_where_it_is_not_is_not_taken_for_bending(world: World) -> None:
    scene, truth, seen, planes = world
    farther = truth.replaced(target_from_spacecraft_km=1.03 * truth.target_from_spacecraft_km)
    held = ONCE.model_copy(update={"hold": ("range",)})
    found = find_pose_jointly(seen, farther, farther, "file", scene, held, distortion=DistortionError(0.0, planes))
    assert found.evidence["bending"] is None


def test_a_held_centre_is_kept_with_its_image_and_the_range_has_the_bendings_error(world: World) -> None:
    scene, truth, seen, planes = world
    held = ONCE.model_copy(update={"hold": ("offset",)})
    known, exact = (
        find_pose_jointly(seen, truth, truth, "file", scene, held, distortion=DistortionError(0.0, bending))
        for bending in (planes, None)
    )
    assert known.evidence["bending"] is None
    assert known.uncertainty["range_factor"] > 1.2 * exact.uncertainty["range_factor"]


def test_the_error_is_never_less_than_what_is_left_of_the_bendings() -> None:
    bending = np.full((2, 4, 4), 0.3, np.float16)
    known: Known = {"uncertainty_px": np.full((4, 4), 0.2, np.float32), "bending_error_px": bending}
    after = known_after(known, strength=1.0, sigma=0.5)
    assert after["uncertainty_px"] == pytest.approx(0.15, rel=1e-2)


def test_flags_are_those_of_all_pixels_that_a_displaced_one_is_made_of(world: World) -> None:
    _, _, seen, _ = world
    quality, image = seen.quality.copy(), seen.image.copy()
    quality[50, 60], image[50, 60] = Quality.MISSING, np.nan
    moved = displaced(replace(seen, image=image, quality=quality), np.full((2, *image.shape), 0.5, np.float32))
    assert np.isfinite(moved.image).all()
    flagged = np.argwhere((moved.quality & Quality.MISSING) != 0)
    assert {tuple(place) for place in flagged.tolist()} == {(49, 59), (49, 60), (50, 59), (50, 60)}


def test_pixels_are_taken_from_where_the_displacement_says(world: World) -> None:
    _, _, seen, _ = world
    step = np.stack([np.full(seen.image.shape, 3.0), np.full(seen.image.shape, -2.0)]).astype(np.float32)
    moved = displaced(seen, step)
    assert moved.image[40:120, 40:120] == pytest.approx(seen.image[38:118, 43:123], abs=1e-4)
    assert moved.noise[40:120, 40:120] == pytest.approx(seen.noise[38:118, 43:123])
    assert not moved.usable[:1].any()


def test_the_step_leaves_the_image_as_it_is_without_the_bending(world: World, tmp_path: Path) -> None:
    scene, truth, seen, planes = world
    folders = {name: tmp_path / name for name in ("undistort", "joint")}
    for folder in folders.values():
        folder.mkdir()
    bent = displaced(seen, -1.5 * planes)
    save_observation(folders["undistort"], bent)
    y, x = np.indices(seen.image.shape, dtype=np.float64)
    known = {
        "uncertainty_px": np.sqrt(0.05**2 + (planes**2).mean(axis=0)).astype(np.float32),
        "bending_error_px": planes.astype(np.float16),
        "sensor_x_px": x,
        "sensor_y_px": y,
    }
    save_arrays(folders["undistort"] / DISTORTION, **known)
    map_path = packaged_map_path(str(scene.target.basemap))
    shown = SceneInputs(
        observation="key of undistort",
        camera=scene.camera,
        target=scene.target,
        basemap=BaseMapInputs(name="map", sha256=sha256_of_file(map_path)),
        simulate=scene.settings,
    )
    inputs = JointInputs(
        scene=shown,
        pose=truth,
        predicted=truth,
        pose_sources=dict.fromkeys(truth.to_dict(), "file"),
        markings_match=True,
        image_moved=False,
        settings=ONCE,
    )
    files = SceneFiles(folders["undistort"], map_path)
    result = run(inputs, files, Work(folders["joint"], lambda *_: None))
    assert result.image_moved
    bending = result.evidence["bending"]
    after = load_observation(folders["joint"])
    off = [np.abs(o.image - seen.image)[20:140, 20:140].mean() for o in (bent, after)]
    print(f"mean difference from the frame without bending: {off[0]:.2f} -> {off[1]:.2f} DN")
    assert off[1] < 0.6 * off[0]
    beside = load_arrays(folders["joint"] / DISTORTION)
    assert beside["bending_error_px"] == pytest.approx(bending["sigma"] * planes, abs=2e-3)
    assert (beside["uncertainty_px"] < known["uncertainty_px"]).any()
    assert beside["uncertainty_px"].min() > 0.049
    # A raw pixel's content lies where the displaced image has it.
    assert beside["sensor_x_px"] == pytest.approx(x - bending["strength"] * planes[0], abs=2e-3)
    assert beside["sensor_y_px"] == pytest.approx(y - bending["strength"] * planes[1], abs=2e-3)
