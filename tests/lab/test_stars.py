"""Simulated star fields: the identifier against a renderer of its own, on a few small frames (`planetpose benchmark
stars` does the same on many of all cameras)."""

import numpy as np
import pytest

from catalog.camera import find_camera
from lab.stars.run import ELSEWHERE, KINDS, NONE, STARS, WRONG_CONE, Scene, do, is_false, scenes, summary, usable

SMALL = ("clementine-lwir", "clementine-hires", "clementine-uvvis")


def test_planted_orientations_are_found() -> None:
    results = [do(Scene(find_camera(SMALL[seed % 3]), STARS, seed)) for seed in range(6)]
    figures = summary(results)
    assert figures["false_locks"] == 0
    assert figures["locked"] >= 5
    errors = [each["error_px"] for each in results if each["lock"]]
    assert np.median(errors) < 0.03
    assert figures["within_2_sigma"] > 0.8


@pytest.mark.parametrize("kind", [NONE, ELSEWHERE, WRONG_CONE])
def test_nothing_is_found_where_nothing_is(kind: str) -> None:
    results = [do(Scene(find_camera(SMALL[seed % 3]), kind, 100 + seed)) for seed in range(3)]
    assert [each for each in results if each["lock"]] == []
    assert all(each["reason"] for each in results)
    assert all(0 < each["false_alarm"] <= 1 for each in results)


def test_scenes_are_of_all_kinds_and_many_cameras() -> None:
    made = list(scenes(60, 7))
    assert {scene.kind for scene in made} == set(KINDS)
    assert len({scene.camera.name for scene in made}) > 15
    assert all(usable(scene.camera) for scene in made)
    assert [scene.seed for scene in made] == [scene.seed for scene in scenes(60, 7)]


def test_a_wrong_orientation_counts_as_a_false_lock() -> None:
    wrong = {"kind": STARS, "lock": True, "error_px": 30.0, "z": [100.0, 1.0, 1.0]}
    assert is_false(wrong)
    assert not is_false({**wrong, "error_px": 0.1})
    assert is_false({**wrong, "error_px": 0.1, "kind": NONE})
    assert not is_false({"kind": NONE, "lock": False})
