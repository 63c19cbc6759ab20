"""A cause is named where one was planted, and none where the failure has none; of scenes drawn at random."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from drawn import Drawn, drawn
from drawn_scenes import scenes
from hostile import Hostile

from catalog.basemap import map_of_target
from catalog.observation import Observation, Quality
from catalog.readers.noise import measured_noise
from catalog.target import find_target
from tasks.diagnose import DiagnoseSettings, trials, tried
from tasks.diagnose.candidates import Candidate
from tasks.diagnose.choice import cause_of
from tasks.diagnose.diagnosis import Diagnosis
from tasks.point.rotation import pose_pointed_at
from tasks.simulate import Scene, SceneSettings
from tasks.undistort.saturation import with_plate_flagged

SETTINGS = DiagnoseSettings()


def observed(scene: Hostile) -> Observation:
    missing = ~np.isfinite(scene.image)
    filled = np.where(missing, 0, scene.image).astype(np.float32)
    quality = np.where(missing, np.uint16(Quality.MISSING), np.uint16(0))
    if scene.mask is not None:
        quality = quality | np.where(scene.mask, np.uint16(Quality.MASKED_BY_USER), np.uint16(0))
    return with_plate_flagged(Observation(filled, measured_noise(filled, ~missing, False), quality))


def cause(scene: Hostile) -> Diagnosis | None:
    """As the step `diagnose` finds it."""
    target = find_target(scene.target)
    simulated = Scene(scene.camera, target, map_of_target(target), SceneSettings(photometry="mixture", oversample=2))
    inside = pose_pointed_at(scene.pose, scene.camera, (np.array(scene.camera.size_px) - 1) / 2)
    observation = observed(scene)
    seen = tried(observation, inside, simulated, SETTINGS)
    return cause_of(seen, observation, inside, simulated, SETTINGS)


@pytest.mark.parametrize(
    ("kind", "code", "remedy"),
    [
        ("mirrored", "image-mirrored", "--flip "),
        ("limb_saturated", "limb-saturated", "shorter exposure"),
        ("masked", "target-masked", "mask"),
        ("stray_light", "stray-light", "subtracted"),
    ],
)
def test_the_planted_cause_is_named(kind: str, code: str, remedy: str) -> None:
    (scene,) = scenes(11, 1, (kind,))
    found = cause(scene)
    print(scene.name, found and (found.code, found.fault, found.remedy))
    assert found is not None
    assert found.code == code
    assert remedy in found.remedy


@pytest.mark.parametrize(("seed", "number"), [(41, 1), (42, 1), (31, 0)])
def test_a_smear_that_leaves_no_limb_to_be_measured_is_named(seed: int, number: int) -> None:
    found = cause(list(scenes(seed, number + 1, ("smeared",)))[number])
    assert found is not None
    assert found.code == "image-blurred"
    assert "smeared by motion" in found.fault or "blurred, by motion" in found.fault


def test_blocks_of_a_compression_come_before_a_disk_that_is_a_little_too_wide() -> None:
    (scene,) = scenes(31, 1, ("compressed",))
    found = cause(scene)
    assert found is not None
    assert found.code == "compression-blocks"


def test_the_flip_that_is_advised_is_the_one_that_undoes_the_planted_one() -> None:
    made = drawn(np.random.default_rng(4), ("europa",), radius_px=28.0, phase_deg=60.0)
    turned = Hostile("turned", "turned", np.rot90(made.image).copy(), made.given, made.camera, made.target)
    found = cause(turned)
    assert found is not None
    assert found.code == "image-turned"
    assert "Give --flip rot90, " in found.remedy  # clockwise, after an anticlockwise turn


def sky_of(made: Drawn, kind: str) -> np.ndarray:
    """A picture without a target: white noise, clouds of some size, or stars."""
    rng = np.random.default_rng(5)
    white = rng.normal(20, 6, made.image.shape)
    if kind == "stars":
        for x, y in rng.integers(4, made.image.shape[0] - 4, (30, 2)):
            white[y - 1 : y + 2, x - 1 : x + 2] += rng.exponential(800)
    if kind.isdigit():
        smooth = cv2.GaussianBlur(rng.standard_normal(made.image.shape), (0, 0), float(kind))
        white += 100 * smooth / smooth.std()
    return white


@pytest.mark.parametrize("kind", ["noise", "stars", "4", "12", "30"])
def test_a_sky_without_a_target_is_explained_by_nothing(kind: str) -> None:
    made = drawn(np.random.default_rng(6), ("rhea",), radius_px=24.0)
    made = replace(made, image=sky_of(made, kind))
    found = cause(Hostile(kind, "empty", made.image, made.given, made.camera, made.target))
    print(found)
    assert found is None


def test_a_flip_is_not_named_because_the_search_for_the_picture_as_it_is_was_misled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The picture is as predicted, at so low a phase angle that a flipped one fits, too; its own search is led away."""
    made = drawn(np.random.default_rng(5), ("europa",), radius_px=28.0, phase_deg=8.0)
    search = trials.best_of

    def misled(family: list[Candidate], scene: Scene, settings: DiagnoseSettings) -> Any:
        found = search(family, scene, settings)
        if found is None or family[0].name != "as-predicted":
            return found
        candidate, find = found
        size_px = np.array(scene.camera.size_px)
        place = scene.camera.project(find.pose.target_in_camera_km)
        corner = np.where(place > size_px / 2, 12.0, size_px - 12.0)
        return candidate, replace(find, pose=pose_pointed_at(find.pose, scene.camera, corner))

    monkeypatch.setattr(trials, "best_of", misled)
    found = cause(Hostile("plain", "plain", made.image, made.given, made.camera, made.target))
    print(found)
    assert found is None or found.code not in ("image-mirrored", "image-turned")
