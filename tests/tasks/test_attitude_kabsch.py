"""The rotation between two sets of points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.rotation import checked_rotation, rotation_from_vector_deg
from tasks.attitude.kabsch import kabsch, robust_kabsch

VECTORS = st.tuples(*[st.floats(-100.0, 100.0)] * 3)


def cap_points(n: int, seed: int, spread: float = 1.0) -> np.ndarray:
    """Points on a cap of the unit sphere, as a camera sees them."""
    rng = np.random.default_rng(seed)
    p = np.column_stack([spread * rng.uniform(-0.7, 0.7, (n, 2)), np.zeros(n)])
    p[:, 2] = np.sqrt(1 - (p**2).sum(axis=1))
    return p


@settings(max_examples=100, deadline=None)
@given(VECTORS, st.integers(3, 40), st.integers(0, 10_000))
def test_any_rotation_is_found_exactly(vector, n, seed) -> None:
    truth, p = rotation_from_vector_deg(vector), 1560 * cap_points(n, seed)
    found = kabsch(p, p @ truth.T, np.random.default_rng(seed).uniform(0.1, 1, n))
    assert found == pytest.approx(truth, abs=1e-6)
    checked_rotation(found, "found")


@settings(max_examples=100, deadline=None)
@given(VECTORS, st.floats(0, 3), st.integers(0, 10_000))
def test_a_reflection_is_never_returned(vector, noise, seed) -> None:
    """Mirrored, flat and noisy sets, for which the best orthogonal matrix would often be a reflection."""
    rng = np.random.default_rng(seed)
    p = cap_points(12, seed)
    mirrored = p @ np.diag([1, -1, 1]) @ rotation_from_vector_deg(vector).T + noise * rng.standard_normal(p.shape)
    found = kabsch(p, mirrored)
    assert np.linalg.det(found) == pytest.approx(1)
    checked_rotation(found, "found")


def test_it_is_the_least_squares_rotation() -> None:
    rng = np.random.default_rng(4)
    p = cap_points(30, 4)
    weight = rng.uniform(0.2, 2, 30)
    q = p @ rotation_from_vector_deg([3, -5, 8]).T + 0.05 * rng.standard_normal(p.shape)

    def cost(rotation: np.ndarray) -> float:
        return float((weight[:, None] * (p @ rotation.T - q) ** 2).sum())

    best = kabsch(p, q, weight)
    for axis in np.vstack([np.eye(3), -np.eye(3)]):
        assert cost(rotation_from_vector_deg(0.1 * axis) @ best) > cost(best)


def test_points_on_one_line_with_the_centre_leave_the_turn_undetermined() -> None:
    line = np.outer([-1.0, 0.5, 2.0, 3.0], [0.6, 0.0, 0.8])
    with pytest.raises(ValueError, match="collinear"):
        kabsch(line, line)
    with pytest.raises(ValueError, match="collinear"):
        robust_kabsch(line, line, np.ones(4))


def test_nearly_collinear_or_lost_vectors_are_refused_too() -> None:
    rng = np.random.default_rng(2)
    bunch = np.array([0.1, -0.2, 0.97]) + 0.01 * rng.standard_normal((50, 3))
    with pytest.raises(ValueError, match="collinear"):
        kabsch(bunch, bunch)
    spread = cap_points(50, 3)
    with pytest.raises(ValueError, match="finite"):
        kabsch(spread, np.where(np.arange(50)[:, None] == 7, np.nan, spread))


@pytest.mark.parametrize(("p", "q"), [((2, 3), (2, 3)), ((4, 3), (5, 3)), ((4, 2), (4, 2)), ((12,), (12,))])
def test_sets_that_do_not_match_are_refused(p: tuple[int, ...], q: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="two equal sets"):
        kabsch(np.ones(p), np.ones(q))


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_outliers_are_left_out(share: float) -> None:
    rng = np.random.default_rng(6)
    truth, p = rotation_from_vector_deg([0.6, -0.3, 0.74]), cap_points(400, 6)
    q = p @ truth.T + 1e-4 * rng.standard_normal(p.shape)
    wrong = rng.random(400) < share
    q[wrong] += [0.03, 0.02, 0] + 0.02 * rng.standard_normal((wrong.sum(), 3))
    found, kept = robust_kabsch(p, q, np.ones(400))
    plain = kabsch(p, q)
    assert (kept & wrong).sum() < 0.05 * wrong.sum()
    assert (kept & ~wrong).sum() > 0.9 * (~wrong).sum()
    assert np.linalg.norm(found - truth) < 1e-4 < 0.1 * np.linalg.norm(plain - truth)
