"""A surface that scatters by another law than the simulation: how wrong it makes pointing and range."""

import numpy as np
import pytest

from lab.simulate.plant import PoseError, planted, pose_error
from lab.simulate.small_world import EUROPA, observation_of, scene_of, small_camera, true_pose
from tasks.point import PointSettings, find_pointing
from tasks.range import RangeSettings, find_range
from tasks.range.similarity_scan import ScanSettings

CAMERA = small_camera(diameter_px=110, size_px=(152, 148)).model_copy(update={"centre_px": (71.3, 79.6)})
TRUTH = true_pose(CAMERA, phase_deg=64.0)
RANGES = {"ssim": RangeSettings(ssim=ScanSettings(step=0.002)), "limb": RangeSettings(method="limb")}


@pytest.fixture(scope="module")
def errors() -> dict[tuple[str, str], PoseError]:
    """Errors after pointing and range by law of the simulation and method; the truth is Lommel-Seeliger."""
    observation = observation_of(scene_of(CAMERA, "lommel-seeliger"), TRUTH)
    wrong = planted(TRUTH, CAMERA, (2.3, -1.4), 0.998, (0, 0, 0))
    found = {}
    for photometry in ("lunar-lambert", "mixture"):
        scene = scene_of(CAMERA, photometry)
        pose = find_pointing(observation, wrong, scene, PointSettings()).pose
        for method, settings in RANGES.items():
            pose = find_range(observation, pose, scene, settings).pose
            found[photometry, method] = pose_error(pose, TRUTH, CAMERA, EUROPA)
    return found


@pytest.mark.parametrize("method", ["ssim", "limb"])
def test_a_mixture_of_laws_is_better_than_one_wrong_law(errors: dict, method: str) -> None:
    print(f"Lommel-Seeliger surface at phase {TRUTH.phase_deg:.0f} deg, range by {method}:")
    for photometry in ("lunar-lambert", "mixture"):
        error = errors[photometry, method]
        centre = np.round(error.centre_px, 3)
        print(f"  {photometry:16s} range {error.range:+.5f}, centre {centre} px, surface {error.surface_px:.3f} px")
    wrong, mixed = errors["lunar-lambert", method], errors["mixture", method]
    assert abs(mixed.range) < 0.2 * abs(wrong.range)
    assert mixed.surface_px < 0.5 * wrong.surface_px
