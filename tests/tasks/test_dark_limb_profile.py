"""The profile across a dark limb, beside medians taken ring by ring."""

import numpy as np
import pytest
from scipy.stats import median_abs_deviation

from tasks.validate.dark_limb import FEWEST_IN_BIN, REACH_PX, medians, radial_profile


@pytest.mark.parametrize("seed", range(5))
def test_medians_of_labels_are_numpy_s(seed: int) -> None:
    random = np.random.default_rng(seed)
    label = np.concatenate([np.arange(7), random.integers(0, 7, 60 + seed)])
    values = random.normal(size=len(label)).round(1)  # ties, too
    found = medians(values, label, np.bincount(label))
    assert found == pytest.approx([np.median(values[label == k]) for k in range(7)])


def test_a_profile_has_the_medians_of_its_rings_and_their_errors() -> None:
    random = np.random.default_rng(3)
    outward = random.uniform(-REACH_PX - 0.49, REACH_PX + 0.49, 900)
    values = np.where(outward < 2, 10.0, 0.0) + random.normal(0, 0.5, 900)
    profile = radial_profile(outward, values, np.full(900, 0.5))
    assert profile is not None
    for k, (middle, error) in enumerate(zip(*profile, strict=True)):
        own = values[np.rint(outward) == k - REACH_PX]
        scatter = max(median_abs_deviation(own, scale="normal"), 0.5)
        assert (middle, error) == pytest.approx((np.median(own), 1.25 * scatter / np.sqrt(len(own))))


def test_a_ring_with_too_few_pixels_leaves_no_profile() -> None:
    outward = np.repeat(np.arange(-REACH_PX, REACH_PX + 1.0), FEWEST_IN_BIN)
    values = np.ones(len(outward))
    assert radial_profile(outward, values, values) is not None
    assert radial_profile(outward[1:], values[1:], values[1:]) is None
    assert radial_profile(outward[:0], values[:0], values[:0]) is None
