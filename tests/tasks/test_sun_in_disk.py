"""The mixture of laws with which a disk's light is sought."""

import numpy as np
import pytest
from scipy.optimize import nnls

from tasks.initial_pose.sun import Samples


def samples(phase_deg: float, laws: tuple[float, ...], noise: float = 0.05) -> tuple[Samples, np.ndarray]:
    """Places in and around a disk lit from +u, with their brightness, and the laws (n, 4) there."""
    random = np.random.default_rng(2)
    u, v = random.uniform(-1.4, 1.4, (2, 900))
    w = np.sqrt(np.maximum(1 - u * u - v * v, 0))
    phase = np.radians(phase_deg)
    mu0 = np.where(w > 0, np.maximum(np.sin(phase) * u + np.cos(phase) * w, 0), 0)
    each = np.stack([mu0, 2 * mu0 / np.maximum(mu0 + w, 1e-6), mu0 * w, mu0 * mu0], axis=1)
    value = each @ laws + noise * random.normal(size=len(u))
    return Samples(u, v, w, value - value.mean()), each


@pytest.mark.parametrize("phase_deg", [5.0, 60.0, 120.0, 179.0])
@pytest.mark.parametrize(
    "laws", [(1.0, 0.0, 0.0, 0.0), (0.3, 0.5, 0.0, 0.2), (0.0, 1.0, -0.6, 0.0), (-1.0, 0.0, 0.0, 0.0)]
)
def test_what_the_best_mixture_leaves_is_what_non_negative_least_squares_leaves(phase_deg, laws) -> None:  # type: ignore[no-untyped-def]
    given, each = samples(phase_deg, laws)
    left = nnls(each - each.mean(axis=0), given.value)[1] ** 2
    assert given.left_over(0.0, phase_deg) == pytest.approx(left, rel=1e-6)


def test_a_disk_without_light_explains_nothing() -> None:
    given, _ = samples(60.0, (1.0, 0.0, 0.0, 0.0))
    assert given.left_over(0.0, 180.0) == pytest.approx(given.total)
