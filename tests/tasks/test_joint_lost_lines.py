"""Lines and columns that a picture lost or has twice are found where they are, and doubted; a whole picture is not."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from catalog.pose import Pose
from lab.simulate.small_world import clean_image, observed, scene_of, small_camera, true_pose
from tasks.correction import Correction
from tasks.joint import JointSettings, find_pose_jointly
from tasks.joint.lost_lines import Step, doubt_of_step
from tasks.simulate import Scene

ONCE = JointSettings(second_start=False)
RADIUS_PX, SIDE = 40.0, 120


@cache
def world() -> tuple[Scene, Pose, NDArray[np.float32]]:
    camera = small_camera(2 * RADIUS_PX, (SIDE, SIDE)).model_copy(update={"centre_px": (SIDE / 2, SIDE / 2)})
    truth = true_pose(camera, phase_deg=40)
    return scene_of(camera, photometry="mixture"), truth, clean_image(scene_of(camera), truth)


def moved(number: int, place: int, axis: str = "lines") -> NDArray[np.float32]:
    """The picture with its lines, or columns, from `place` on `number` further on, or back where negative."""
    picture = np.array(world()[2])
    along = picture.T if axis == "columns" else picture
    whole = along.copy()
    if number < 0:
        along[place:number] = whole[place - number :]
    elif number > 0:
        along[place + number :] = whole[place:-number]
    return picture


def found_in(picture: NDArray[np.float32], settings: JointSettings = ONCE) -> Correction:
    scene, truth, _ = world()
    return find_pose_jointly(observed(picture), truth, truth, "file", scene, settings)


@pytest.mark.parametrize(("number", "place"), [(-1, 60), (1, 50), (-2, 66)])
@pytest.mark.parametrize("axis", ["lines", "columns"])
def test_lost_and_repeated_lines_are_found_and_doubted(axis: str, number: int, place: int) -> None:
    found = found_in(moved(number, place, axis))
    step = found.evidence["step"]
    print(f"\n{step}")
    assert step["axis"] == axis
    assert step["size_px"] == pytest.approx(number, abs=0.5 * abs(number))
    assert step["place_px"] == pytest.approx(place, abs=RADIUS_PX / 4)
    assert "lines-missing: from about " in found.evidence["doubt"]


def test_a_whole_picture_has_no_step() -> None:
    found = found_in(moved(0, 0))
    print(f"\n{found.evidence['step']}")
    assert abs(found.evidence["step"]["size_px"]) < 0.1
    assert "lines-missing" not in found.evidence.get("doubt", "")


def test_optics_taken_for_exact_are_not_looked_at() -> None:
    assert found_in(moved(0, 0), ONCE.model_copy(update={"displaced_px": None})).evidence["step"] is None


def test_the_doubt_says_where_and_how_many() -> None:
    limits = ONCE.thresholds.contradiction
    assert doubt_of_step(None, limits) is None
    assert doubt_of_step(Step("lines", 50.2, -0.3, 0.1), limits) is None
    lost, twice = (
        doubt_of_step(Step(*step), limits) for step in (("lines", 50.2, -1.9, 0.1), ("columns", 7, 0.9, 0.2))
    )
    assert lost is not None
    assert twice is not None
    assert "from about line 50 on" in lost
    assert "2 lines were lost" in lost
    assert "from about column 7 on" in twice
    assert "1 column was repeated" in twice
