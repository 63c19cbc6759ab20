"""A limb too short to tell the range from the centre keeps the range that it began with; a long one does not care."""

import numpy as np
import pytest

from tasks.compare.limb_fit import LimbFit
from tasks.range.limb import LIMIT_SIGMAS, LimbRangeSettings, with_range_known

RADIUS_PX, EDGE_PX = 90.0, 0.1
SIGMA = LimbRangeSettings().limit / LIMIT_SIGMAS


def fit_of(arc_deg: float, middle_deg: float, offset_px: tuple[float, float], growth: float, seed: int) -> LimbFit:
    """Least squares on 60 edges of an arc, each off by EDGE_PX of noise."""
    angle = np.radians(middle_deg + np.linspace(-arc_deg / 2, arc_deg / 2, 60))
    design = np.column_stack([np.cos(angle), np.sin(angle), np.full(60, RADIUS_PX)])
    shift = design @ (*offset_px, growth) + np.random.default_rng(seed).normal(0, EDGE_PX, 60)
    covariance = np.linalg.inv(design.T @ design) * EDGE_PX**2
    solution = np.linalg.solve(design.T @ design, design.T @ shift)
    return LimbFit(solution[:2], float(solution[2]), covariance, covariance, EDGE_PX, design, np.degrees(angle))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("arc_deg", [180.0, 360.0])
def test_a_long_arc_tells_the_range(arc_deg: float, seed: int) -> None:
    fit = fit_of(arc_deg, 30.0 * seed, (2.0, -1.0), 0.04, seed)
    found = with_range_known(fit, 0.0, SIGMA)
    assert found.growth == pytest.approx(fit.growth, abs=0.1 * np.sqrt(fit.covariance[2, 2]))
    assert found.offset_px == pytest.approx(fit.offset_px, abs=0.01)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("arc_deg", [8.0, 15.0, 25.0])
def test_a_short_arc_keeps_the_range_and_says_how_well_it_is_known(arc_deg: float, seed: int) -> None:
    fit = fit_of(arc_deg, 80.0 * seed, (2.0, -1.0), 0.004, seed)
    found = with_range_known(fit, 0.0, SIGMA)
    own = np.sqrt(fit.covariance[2, 2])
    assert np.sqrt(found.covariance[2, 2]) <= min(own, SIGMA)
    assert abs(found.growth) <= abs(fit.growth)
    # Where both are known, the place of the arc itself does not move.
    middle = np.median(fit.design @ (*(found.offset_px - fit.offset_px), found.growth - fit.growth))
    assert abs(middle) < EDGE_PX
    errors = np.array([*(found.offset_px - (2.0, -1.0)), found.growth - 0.004])
    assert errors @ np.linalg.solve(found.covariance, errors) < 30


@pytest.mark.parametrize("grown", [-0.03, 0.0, 0.05])
@pytest.mark.parametrize("arc_deg", [12.0, 60.0, 200.0])
def test_it_is_the_least_squares_with_one_more_observation(arc_deg: float, grown: float) -> None:
    fit = fit_of(arc_deg, 40.0, (0.5, 0.7), 0.01, 7)
    found = with_range_known(fit, grown, SIGMA)
    design = np.vstack([fit.design / EDGE_PX, (0, 0, 1 / SIGMA)])
    values = np.append(fit.design @ (*fit.offset_px, fit.growth) / EDGE_PX, -grown / SIGMA)
    expected = np.linalg.lstsq(design, values, rcond=None)[0]
    assert (*found.offset_px, found.growth) == pytest.approx(expected, rel=1e-5, abs=1e-7)
    assert found.covariance == pytest.approx(np.linalg.inv(design.T @ design), rel=1e-4, abs=1e-12)
