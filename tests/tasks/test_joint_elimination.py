"""Tiles' own unknowns eliminated in compiled passes, against dense linear algebra of all unknowns at once."""

import numpy as np
import pytest

from tasks.joint.elimination import Columns, eliminated, in_order, residuals

HUBER = 2.5
SHAPE, N, LOCAL, TILES = (23, 31), 5, 3, 4


@pytest.fixture(scope="module")
def problem() -> tuple[Columns, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Columns in the order of their tiles, that order, weights, priors, and the tile (-1: none) of each pixel."""
    rng = np.random.default_rng(7)
    columns = rng.normal(size=(N, *SHAPE)).astype(np.float32)
    local = rng.normal(size=(LOCAL, *SHAPE)).astype(np.float32)
    image = (columns.sum(axis=0) + 0.1 * rng.normal(size=SHAPE)).astype(np.float32)
    image[3, 4] += 30  # an outlier
    tile = rng.integers(-1, TILES, size=image.size)
    order = np.argsort(tile, kind="stable")
    ends = np.searchsorted(tile[order], np.arange(-1, TILES), side="right")
    base = rng.uniform(0.5, 2.0, image.size).astype(np.float32)
    prior = rng.uniform(0.5, 3.0, (TILES, LOCAL))
    return in_order(columns, local, image, order, ends), order, base, prior, tile[order]


def dense(columns: Columns, tile: np.ndarray) -> np.ndarray:
    """All columns (pixels, n + tiles * local), each tile's own zero outside it."""
    n = columns.n
    whole = np.zeros((len(tile), n + TILES * LOCAL))
    whole[:, :n] = columns.design[:n].T
    for t in range(TILES):
        at = tile == t
        whole[at, n + t * LOCAL : n + (t + 1) * LOCAL] = columns.design[n:, at].T
    return whole


@pytest.mark.parametrize("given", ["nothing", "residual", "fit"])
def test_the_rest_of_the_equations_is_that_of_all_unknowns(problem: tuple, given: str) -> None:  # type: ignore[type-arg]
    columns, _, base, prior, tile = problem
    whole, target = dense(columns, tile), columns.target.astype(np.float64)
    values = np.ones(N)
    own = np.full((TILES, LOCAL), 0.05)
    left = target - whole @ np.concatenate([values, own.ravel()])
    residual = left.astype(np.float32) if given == "residual" else None
    found = eliminated(columns, base, residual, (values, own) if given == "fit" else None, HUBER, prior)
    lowered = 1.0 if given == "nothing" else np.minimum(1, HUBER / np.maximum(np.abs(left) * np.sqrt(base), 1e-12))
    weight = base * lowered
    normal = whole.T @ (weight[:, None] * whole) + np.diag(np.concatenate([np.zeros(N), prior.ravel()]))
    right = whole.T @ (weight * target)
    common, tiles = np.linalg.solve(normal, right)[:N], slice(N, None)
    schur = normal[:N, :N] - normal[:N, tiles] @ np.linalg.solve(normal[tiles, tiles], normal[tiles, :N])
    assert found.information == pytest.approx(schur, rel=1e-5, abs=1e-3)
    assert np.linalg.solve(found.information, found.right) == pytest.approx(common, abs=1e-5)
    again = found.by_all[..., N] - found.by_all[..., :N] @ common
    assert again.ravel() == pytest.approx(np.linalg.solve(normal, right)[tiles], abs=1e-5)
    for t in range(TILES):
        block = normal[N + t * LOCAL : N + (t + 1) * LOCAL, N + t * LOCAL : N + (t + 1) * LOCAL]
        assert found.inverse[t] == pytest.approx(np.linalg.inv(block), rel=1e-5, abs=1e-7)
        assert found.gain_information[t] == pytest.approx(block[0, 0] - prior[t, 0], rel=1e-5)


def test_residuals_and_cost_are_hubers(problem: tuple) -> None:  # type: ignore[type-arg]
    columns, order, base, _, tile = problem
    values, own = np.ones(N), np.full((TILES, LOCAL), 0.05)
    found = residuals(columns, order, base, (values, own), 1, HUBER)
    left = columns.target - dense(columns, tile) @ np.concatenate([values, own.ravel()])
    size = np.abs(left) * np.sqrt(base)
    assert found.residual[order] == pytest.approx(left, abs=1e-4)
    assert found.weight[order] == pytest.approx(base * np.minimum(1, HUBER / np.maximum(size, 1e-12)), rel=1e-4)
    cost = np.where(size <= HUBER, size**2, HUBER * (2 * size - HUBER)).sum()
    assert found.cost == pytest.approx(cost, rel=1e-5)
    assert size.max() > HUBER
    inside = tile >= 0
    assert found.gain[order][inside] == pytest.approx(0.05, rel=1e-4)
    assert not found.gain[order][~inside].any()
