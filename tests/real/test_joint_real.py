"""The joint estimator on real images: the range as a test of the model, and the same pose however the image is seen."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from real_bench import Bench

from catalog.basemap import map_of_target, read_map
from catalog.camera import find_camera
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.readers import read_frame
from catalog.target import find_target
from tasks.compare.reduce import reduced_observation, reduced_scene
from tasks.joint import JointSettings, find_pose_jointly
from tasks.simulate import Scene, SceneSettings
from tasks.undistort import UndistortSettings, undistort

pytestmark = pytest.mark.real

LIMB_BAR_PX, RANGE_BAR = 0.35, 1e-3
MIXTURE = SceneSettings(photometry="mixture")


def assert_meets_the_bars(result: dict[str, Any]) -> None:
    free, sigma = result["range_factor_free"], result["uncertainty"]["range_factor_free"]
    print(
        f"\n{result['product']}: {result['status']}, centre {np.round(result['centre_px'], 3)}, free range {free:.5f}"
    )
    print(f"  +- {sigma:.5f} (bar: 1 within {RANGE_BAR} and 3 sigma)")
    print(f"  limb {result['limb_rms_px']:.3f} px (bar {LIMB_BAR_PX})")
    assert result["status"] == "ok"
    assert abs(free - 1) < RANGE_BAR
    assert abs(free - 1) < 3 * sigma
    assert result["limb_rms_px"] <= LIMB_BAR_PX


def test_the_free_range_of_europa_by_galileo_is_the_trajectorys(europa: dict[str, Any]) -> None:
    assert europa["profile"] == "joint"
    assert_meets_the_bars(europa)


def test_the_free_range_of_pluto_by_lorri_is_the_trajectorys(bench: Bench) -> None:
    assert_meets_the_bars(bench.correct(bench.image("new_horizons/lor_0299140073_0x630_sci.fit")))


def half_masked(observation: Observation, centre_px: tuple[float, float]) -> Observation:
    """The right half of the disk not used."""
    columns = np.arange(observation.image.shape[1])
    quality = observation.quality.copy()
    quality[:, columns > centre_px[0]] |= np.uint16(Quality.MISSING)
    return replace(observation, quality=quality)


def test_the_same_pose_with_another_map_half_of_the_disk_and_rebinned(europa: dict[str, Any], bench: Bench) -> None:
    frame, camera, target = (
        read_frame(bench.image("galileo/C0552809300R.IMG")),
        find_camera("galileo-ssi"),
        find_target("europa"),
    )
    seen = undistort(frame.observation, camera, UndistortSettings(), frame.undistorted).observation
    before = xr.open_zarr(Path(europa["cube"])).attrs["pose_before"]
    predicted = Pose.from_dict(json.loads(before) if isinstance(before, str) else before)
    start, once = Pose.from_dict(europa["pose"]), JointSettings(second_start=False)
    scene = Scene(camera, target, map_of_target(target), MIXTURE)
    voyager = read_map(bench.data / "maps" / "europa_voyager_equirect_2048_left0E.png", 0.0)
    x, y = europa["centre_px"]
    variants = {
        "another map": (seen, Scene(camera, target, voyager, MIXTURE), 1),
        "half masked": (half_masked(seen, (x, y)), scene, 1),
        "rebinned 2 x 2": (reduced_observation(seen, 2), reduced_scene(scene, 2), 2),
    }
    for name, (observation, other, n) in variants.items():
        found = find_pose_jointly(observation, start, predicted, "label", other, once)
        centre = n * other.camera.project(found.pose.target_in_camera_km) + (n - 1) / 2
        sigma = np.hypot(europa["uncertainty"]["centre_px"], n * np.array(found.uncertainty["offset_px"]))
        free, free_sigma = found.changed["range_factor_free"], found.uncertainty["range_factor_free"]
        apart = np.array(centre) - (x, y)
        print(
            f"\n{name}: centre {np.round(apart, 3)} px away ({np.round(apart / sigma, 1)} sigma), free range {free:.5f}"
        )
        assert (np.abs(apart) < 3 * sigma).all()
        assert abs(free - europa["range_factor_free"]) < 3 * np.hypot(
            free_sigma, europa["uncertainty"]["range_factor_free"]
        )
