"""Planted errors of the distance are found again by both methods; the scan widens, says so, and has a limit."""

import numpy as np
import pytest

from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.pose import Pose
from lab.simulate.plant import planted, pose_error
from lab.simulate.small_world import EUROPA, observation_of, scene_of, small_camera, true_pose
from tasks.range import RangeSettings, find_range
from tasks.range.similarity_scan import ScanSettings

CAMERA = small_camera(diameter_px=120, size_px=(164, 156)).model_copy(update={"centre_px": (77.3, 81.6)})
TRUTH = true_pose(CAMERA)
BAR = 5e-4
OFFSET_PX = (0.6, -0.4)
QUICK = ScanSettings(step=0.002)


@pytest.fixture(scope="module")
def observation() -> Observation:
    return observation_of(scene_of(CAMERA), TRUTH)


def wrong(factor: float, offset_px: tuple[float, float] = (0.0, 0.0)) -> Pose:
    return planted(TRUTH, CAMERA, offset_px, factor, (0, 0, 0))


@pytest.mark.parametrize(
    ("photometry", "settings"),
    [
        ("lunar-lambert", RangeSettings()),
        ("mixture", RangeSettings(method="limb")),
        ("lunar-lambert", RangeSettings(ssim=ScanSettings(step=0.002, diameter_px=60))),
    ],
    ids=["paper's scan", "limb, mixture", "binned 2 x 2"],
)
def test_the_planted_range_is_recovered(observation: Observation, photometry: str, settings: RangeSettings) -> None:
    found = find_range(observation, wrong(0.995, OFFSET_PX), scene_of(CAMERA, photometry, oversample=4), settings)
    error, centre = found.changed["range_factor"] - 0.995, pose_error(found.pose, TRUTH, CAMERA, EUROPA).centre_px
    sigma = found.evidence["formal"]["range_factor"]
    print(f"range 0.995: error {error:+.6f}, formal {sigma:.6f}, centre off by {np.hypot(*centre):.4f} px, bar {BAR}")
    assert abs(error) < BAR
    stated = found.uncertainty["range_factor"]
    assert stated is None if settings.method == "ssim" else stated > max(sigma, abs(error) / 2)
    assert found.pose.range_km == pytest.approx(TRUTH.range_km, rel=BAR)
    assert np.hypot(*centre) < 0.05
    assert found.changed["offset_px"] == pytest.approx(OFFSET_PX, abs=0.05)  # which a wrong range spoils
    assert found.evidence.get("widened") in (False, None)
    np.testing.assert_array_equal(found.pose.body_from_j2000, TRUTH.body_from_j2000)


@pytest.mark.parametrize("factor", [0.983, 1.02])
def test_the_scan_is_widened_when_the_optimum_is_at_its_edge_and_says_so(
    observation: Observation, factor: float
) -> None:
    found = find_range(observation, wrong(factor), scene_of(CAMERA, oversample=3), RangeSettings(ssim=QUICK))
    error = found.changed["range_factor"] - factor
    print(f"range {factor}: error {error:+.6f}, {len(found.evidence['scan'])} factors")
    assert abs(error) < BAR
    assert found.evidence["widened"] is True
    factors = [factor for factor, _ in found.evidence["scan"]]
    assert np.diff(factors) == pytest.approx(0.002, abs=1e-6)
    assert min(factors) < 0.981 if factor < 1 else max(factors) > 1.021
    assert found.evidence["similarity_after"] > found.evidence["similarity_before"]


@pytest.mark.parametrize("method", ["ssim", "limb"])
@pytest.mark.parametrize("factor", [0.93, 1.08])
def test_a_range_beyond_the_limit_fails(observation: Observation, method: str, factor: float) -> None:
    settings = RangeSettings.model_validate({"method": method, "ssim": {"step": 0.005}})
    with pytest.raises(FailedError) as failure:
        find_range(observation, wrong(factor), scene_of(CAMERA, oversample=2), settings)
    assert failure.value.code == "range-out-of-bounds"
    assert "range" in failure.value.remedy


def test_a_higher_limit_lets_a_larger_error_be_corrected(observation: Observation) -> None:
    settings = RangeSettings.model_validate({"ssim": {"step": 0.005, "widen": 0.02, "limit": 0.12}})
    found = find_range(observation, wrong(0.93), scene_of(CAMERA, oversample=3), settings)
    print(f"range 0.93 with a limit of 0.12: error {found.changed['range_factor'] - 0.93:+.6f}")
    assert found.changed["range_factor"] == pytest.approx(0.93, abs=BAR)


def test_a_right_range_stays(observation: Observation) -> None:
    found = find_range(observation, TRUTH, scene_of(CAMERA), RangeSettings(method="limb"))
    assert found.changed["range_factor"] == pytest.approx(1, abs=BAR)
    assert found.changed["offset_px"] == pytest.approx((0, 0), abs=0.05)


def test_the_limb_needs_some_limb(observation: Observation) -> None:
    dark = Observation(np.zeros_like(observation.image), observation.noise, observation.quality)
    with pytest.raises(FailedError) as failure:
        find_range(dark, TRUTH, scene_of(CAMERA, oversample=2), RangeSettings(method="limb"))
    assert failure.value.code == "limb-not-measured"
