"""Where the image puts the Sun, and when that is a doubt."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from catalog.pose import Pose
from lab.simulate.plant import planted
from lab.simulate.small_world import observation_of, scene_of, small_camera, true_pose
from tasks.accept.acceptance import doubtful_sun
from tasks.accept.settings import AcceptSettings
from tasks.simulate.suns import with_sun_moved
from tasks.validate.sun import SunReport, sun_in_image

CAMERA = small_camera(80.0, (120, 116)).model_copy(update={"centre_px": (59.5, 57.5)})


def azimuth_deg(pose: Pose) -> float:
    x, y, _ = pose.camera_from_j2000 @ pose.sun_from_target_km
    return float(np.degrees(np.arctan2(y, x)))


@pytest.mark.parametrize("azimuth", [-50.0, 20.0])
@pytest.mark.parametrize("phase", [0.0, 12.0])
def test_the_sun_is_moved_in_the_image_and_in_phase(azimuth: float, phase: float) -> None:
    pose = true_pose(CAMERA)
    moved = with_sun_moved(pose, azimuth, phase)
    assert moved.phase_deg - pose.phase_deg == pytest.approx(phase, abs=1e-6)
    turned = (azimuth_deg(moved) - azimuth_deg(pose) + 180) % 360 - 180
    assert turned == pytest.approx(azimuth, abs=0.05)
    assert np.linalg.norm(moved.sun_from_target_km) == pytest.approx(np.linalg.norm(pose.sun_from_target_km))


@pytest.mark.parametrize("phase_deg", [30.0, 70.0, 115.0])
@pytest.mark.parametrize("photometry", ["lambert", "lunar-lambert"])
def test_a_planted_turn_of_the_sun_is_found_and_the_right_sun_is_not_doubted(phase_deg: float, photometry: str) -> None:
    """With centre and range where a wrong Sun would draw them."""
    truth = true_pose(CAMERA, phase_deg=phase_deg)
    seen = observation_of(scene_of(CAMERA, photometry), truth)
    for turn, farther in ((0.0, 0.0), (20.0, 0.0), (-40.0, 0.0), (65.0, 0.0), (0.0, 25.0)):
        share = np.hypot(turn, farther) / 40
        claimed = planted(with_sun_moved(truth, turn, farther), CAMERA, (share, -share), 1 + 4e-3 * share, (0, 0, 0))
        found = sun_in_image(seen, claimed, scene_of(CAMERA, "mixture"))
        print(turn, farther, found)
        doubt = doubtful_sun(AcceptSettings(), found)
        assert found.azimuth_deg is not None
        assert found.phase_deg is not None
        if turn == farther == 0:
            assert doubt is None
        else:
            assert doubt is not None
            assert doubt.startswith("sun-direction-disagrees: ")
        assert (found.azimuth_deg + turn) * np.sin(np.radians(phase_deg)) == pytest.approx(0, abs=2.0)
        assert found.phase_deg + farther == pytest.approx(0, abs=4.0)


def test_what_shows_no_disk_tells_nothing_of_the_sun() -> None:
    truth = true_pose(CAMERA)
    seen = observation_of(scene_of(CAMERA, "lambert"), truth)
    nothing = type(seen)(seen.image * np.nan, seen.noise, seen.quality)
    assert sun_in_image(nothing, truth, scene_of(CAMERA, "mixture")) == SunReport()
    behind = true_pose(CAMERA, phase_deg=1.0)
    assert sun_in_image(observation_of(scene_of(CAMERA, "lambert"), behind), behind, scene_of(CAMERA)) == SunReport()


@pytest.mark.parametrize(
    ("sun", "settings", "is_doubted"),
    [
        ({"across_deg": 6.0, "across_sigma_deg": 0.5, "phase_deg": 0.0, "phase_sigma_deg": 1.5}, {}, True),
        ({"across_deg": 4.0, "across_sigma_deg": 0.5, "phase_deg": 0.0, "phase_sigma_deg": 1.5}, {}, False),
        ({"across_deg": 6.0, "across_sigma_deg": 2.0, "phase_deg": 0.0, "phase_sigma_deg": 1.5}, {}, False),
        ({"across_deg": 0.0, "across_sigma_deg": 0.5, "phase_deg": -12.0, "phase_sigma_deg": 1.5}, {}, True),
        (
            {"across_deg": 0.0, "across_sigma_deg": 0.5, "phase_deg": -12.0, "phase_sigma_deg": 1.5},
            {"sun_phase_deg": None},
            False,
        ),
        ({"across_deg": None}, {}, False),
    ],
)
def test_a_doubt_needs_both_a_size_and_an_error_that_is_smaller(
    sun: dict[str, Any], settings: dict[str, Any], is_doubted: bool
) -> None:
    seen = SunReport(azimuth_deg=9.0, azimuth_sigma_deg=1.0, **sun)
    assert (doubtful_sun(AcceptSettings(**settings), seen) is not None) == is_doubted
    assert doubtful_sun(AcceptSettings(), SunReport()) is None


@pytest.mark.parametrize(("towards", "sure"), [(None, True), (0.0, False), (1.2, False)])
def test_albedo_that_no_map_shows_is_in_the_error_of_the_sun(towards: float | None, sure: bool) -> None:
    """A surface that brightens across the disk, and varies at all lengths, as maps of moons do."""
    truth = true_pose(CAMERA, phase_deg=30.0)
    scene = scene_of(CAMERA, "lambert")
    seen = observation_of(scene, truth)
    if towards is not None:
        y, x = (np.indices(seen.image.shape) - np.array([57.5, 59.5])[:, None, None]) / 40.0
        along, across = np.cos(towards) * x + np.sin(towards) * y, np.cos(towards) * y - np.sin(towards) * x
        pattern = 0.25 * along + 0.15 * np.sin(4 * along) * np.cos(3 * across) + 0.15 * np.sin(3 * across - 1)
        seen = replace(seen, image=(seen.image * (1 + 0.8 * pattern)).astype(np.float32))
    found = sun_in_image(seen, truth, scene_of(CAMERA, "mixture"))
    print(found)
    assert found.across_deg is not None
    assert found.across_sigma_deg is not None
    assert (found.across_sigma_deg < 1.6) == sure
    assert abs(found.across_deg) < 3 * found.across_sigma_deg
    assert doubtful_sun(AcceptSettings(), found) is None
