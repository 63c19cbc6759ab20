"""The linear problem of the joint step, against dense least squares."""

from dataclasses import replace

import numpy as np
import pytest

from catalog.robust import huber_weight
from tasks.joint.normal_equations import LinearProblem, scaled_inverse, solve_linear
from tasks.joint.settings import TileSettings
from tasks.joint.thresholds import Thresholds
from tasks.joint.tile_prior import first_prior, learned_prior, limb_gain
from tasks.joint.tiles import LOCAL, layout_for, tiles_of

SHAPE, RADIUS = (48, 52), 18.0
NOISE = 0.02
TILES = TileSettings()


def problem(local_sigma: float = 0.3, seed: int = 1) -> tuple[LinearProblem, np.ndarray, np.ndarray]:
    """Three columns with known values, tiles with known gains, and noise; the weights (ny, nx)."""
    rng = np.random.default_rng(seed)
    tiles = tiles_of(SHAPE, np.array([25.0, 23.0]), RADIUS, layout_for(RADIUS, TileSettings()))
    y, x = np.indices(SHAPE)
    inside = (tiles.label >= 0).astype(np.float32)
    bright = inside * (1 + 0.3 * np.sin(x / 5.0) * np.cos(y / 7.0)).astype(np.float32)
    columns = np.stack([bright, inside * (x - 25) / 18, np.ones(SHAPE)]).astype(np.float32)
    local = np.stack([bright, bright * tiles.along, bright * tiles.across, 0.1 * inside]).astype(np.float32)
    values = np.array([2.0, -0.4, 0.5])
    own = rng.normal(0, 0.05, (tiles.count, LOCAL))
    image = np.tensordot(values, columns, 1) + NOISE * rng.standard_normal(SHAPE)
    for a in range(LOCAL):
        image += np.where(tiles.label >= 0, local[a] * own[tiles.label, a], 0)
    prior = np.full((tiles.count, LOCAL), local_sigma**-2)
    given = LinearProblem(
        image.astype(np.float32),
        columns,
        local,
        tiles,
        np.array([0.0, 4.0, 0.0]),
        np.array([0.0, -0.3, 0.0]),
        prior,
        np.inf,
        Thresholds(),
    )
    return given, values, np.full(SHAPE, NOISE**-2, np.float32)


def dense(given: LinearProblem, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All unknowns at once: values and covariance of the common ones."""
    n, tiles = len(given.columns), given.tiles
    design = np.zeros((given.image.size, n + tiles.count * LOCAL))
    design[:, :n] = given.columns.reshape(n, -1).T
    label = tiles.label.ravel()
    for pixel in np.flatnonzero(label >= 0):
        at = n + label[pixel] * LOCAL
        design[pixel, at : at + LOCAL] = given.local.reshape(LOCAL, -1)[:, pixel]
    prior = np.concatenate([given.prior, given.local_prior.ravel()])
    expected = np.concatenate([given.expected, np.zeros(given.local_prior.size)])
    normal = (design * weight.ravel()[:, None]).T @ design + np.diag(prior)
    right = (design * weight.ravel()[:, None]).T @ given.image.ravel() + prior * expected
    covariance = np.linalg.inv(normal)
    return (covariance @ right)[:n], covariance[:n, :n]


def test_eliminating_the_tiles_is_solving_for_all() -> None:
    given, _, weight = problem()
    fit = solve_linear(given, weight)
    values, covariance = dense(given, weight)
    assert fit.values == pytest.approx(values, rel=1e-4, abs=1e-5)
    assert fit.covariance == pytest.approx(covariance, rel=1e-3, abs=1e-9)


def test_what_was_planted_is_found_within_its_error() -> None:
    given, values, weight = problem(0.05)
    fit = solve_linear(replace(given, prior=np.zeros(3)), weight)
    assert (np.abs(fit.values - values) < 4 * np.sqrt(np.diag(fit.covariance))).all()
    assert np.sqrt(np.mean((fit.residual * np.sqrt(weight)) ** 2)) == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("huber", [0.7, 2.5, np.inf])
def test_weights_and_cost_are_hubers_of_the_residuals(huber: float) -> None:
    given, _, weight = problem()
    given = replace(given, huber=huber)
    fit = solve_linear(given, weight)
    own = np.where(given.tiles.label >= 0, np.moveaxis(fit.own[given.tiles.label], -1, 0), 0)
    model = np.tensordot(fit.values, given.columns, 1) + (given.local * own).sum(axis=0)
    assert fit.residual == pytest.approx(given.image - model, abs=1e-5)
    size = np.abs(fit.residual) * np.sqrt(weight)
    assert fit.weight == pytest.approx(weight * huber_weight(size, huber), rel=1e-4)
    pixels = np.where(size <= huber, size**2, huber * (2 * size - huber) if np.isfinite(huber) else 0).sum()
    priors = given.prior @ (fit.values - given.expected) ** 2 + np.sum(given.local_prior * fit.own**2)
    assert fit.cost == pytest.approx(pixels + priors, rel=1e-4)


def test_outliers_hardly_count() -> None:
    given, _, weight = problem()
    spoiled = given.image.copy()
    spoiled.ravel()[::97] += 50 * NOISE
    clean, robust, plain = (
        solve_linear(replace(given, image=image, huber=huber), weight).values
        for image, huber in ((given.image, np.inf), (spoiled, 2.5), (spoiled, np.inf))
    )
    assert np.linalg.norm(robust - clean) < 0.5 * np.linalg.norm(plain - clean)


def test_more_unknowns_come_first_and_are_about_zero() -> None:
    given, _, weight = problem()
    y, x = np.indices(SHAPE)
    column = ((x - y) / 30).astype(np.float32)
    wider = given.extended(column[None], np.array([1e12]))
    held, plain = solve_linear(wider, weight), solve_linear(given, weight)
    assert abs(held.values[0]) < 1e-6
    assert held.values[1:] == pytest.approx(plain.values, rel=1e-5)
    added = replace(wider, image=given.image + 0.3 * column, prior=np.concatenate([[0.0], given.prior]))
    assert solve_linear(added, weight).values[0] == pytest.approx(
        0.3 + solve_linear(replace(added, image=given.image), weight).values[0], abs=1e-4
    )


def test_a_direction_without_information_gets_none() -> None:
    matrix = np.diag([1e12, 1e-6, 0.0])
    assert scaled_inverse(matrix) == pytest.approx(np.diag([1e-12, 1e6, 0.0]))
    column = np.array([1.0, 2.0, 3.0])
    along = np.outer(column, column)
    assert scaled_inverse(along) == pytest.approx(np.linalg.pinv(along / along) / along)


def test_an_inverse_does_not_depend_on_how_well_its_directions_are_known() -> None:
    """Beyond 1e-9 of the largest eigenvalue another way leads to it; the same inverse where both are good."""
    random = np.random.default_rng(3)
    axes = np.linalg.qr(random.normal(size=(6, 6)))[0]
    for least in (1e-2, 1e-8):
        size = np.array([least, 1.0, 1.0, 1.0, 1.0, 2.0])
        matrix, inverse = (axes * size) @ axes.T, (axes / size) @ axes.T
        assert scaled_inverse(matrix) == pytest.approx(inverse, rel=1e-5, abs=1e-7 / least)


@pytest.mark.parametrize("gain", [0.0, 0.05, 0.2])
def test_the_spread_of_the_gains_is_learned_and_tiles_that_fit_are_held(gain: float) -> None:
    """Chance lets a few images pass that need no tiles: the median of seven."""
    learned, seen = [], []
    for seed in range(7):
        given, _, weight = problem(0.3)
        rng = np.random.default_rng(seed)
        tiles, bright = given.tiles, given.columns[0]
        own = np.where(tiles.label >= 0, gain * rng.standard_normal(tiles.count)[tiles.label], 0)
        image = np.tensordot([2.0, 0.0, 0.5], given.columns, 1) + own * bright
        image += NOISE * rng.standard_normal(image.shape)
        before = first_prior(tiles.count, TILES)
        fit = solve_linear(replace(given, image=image.astype(np.float32), local_prior=before), weight)
        learned.append(learned_prior(fit, before, tiles.sectors, TILES)[-1, 0] ** -0.5)
        seen.append(limb_gain(fit, before, tiles.sectors, TILES))
    print(f"gains of {gain}: known to {np.round(learned, 4)}, along the limb {np.round(seen, 4)}")
    if gain == 0:
        assert np.median(learned) <= 2 * TILES.smallest
    else:
        assert gain < np.median(learned) <= TILES.gain + 1e-9
    assert np.median(seen) == pytest.approx(gain, rel=0.3, abs=0.01)
