"""The simulator's surface: Hapke's law, the variation from place to place, and the draws."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catalog.basemap import uniform_map
from lab.simulate.cameras import simulated_cameras
from lab.simulate.randomness import SmoothField, exponential_between, generator
from lab.simulate.surface import MISMATCHED, TrueSurface, mismatched_surface
from tasks.photometry.hapke import HapkeSurface, hapke

ANGLES = st.floats(1, 85)


def _cos_phase(incidence: float, emission: float, azimuth: float) -> float:
    i, e, psi = np.radians([incidence, emission, azimuth])
    return float(np.cos(i) * np.cos(e) + np.sin(i) * np.sin(e) * np.cos(psi))


@given(ANGLES, ANGLES, st.floats(0, 175))
def test_hapke_is_reciprocal_and_positive(incidence: float, emission: float, azimuth: float) -> None:
    mu0, mu = (np.array([np.cos(np.radians(angle))]) for angle in (incidence, emission))
    cos_phase = np.array([_cos_phase(incidence, emission, azimuth)])
    there = hapke(mu0, mu, cos_phase, HapkeSurface()) / mu0
    back = hapke(mu, mu0, cos_phase, HapkeSurface()) / mu
    assert there[0] > 0
    np.testing.assert_allclose(there, back, rtol=1e-9)


def test_a_smooth_dark_surface_scatters_once() -> None:
    surface = HapkeSurface(w=1e-6, b=0.0, c=0.0, b0=0.0, theta_deg=0.0)
    mu0, mu = np.array([0.8, 0.3]), np.array([0.6, 0.9])
    expected = surface.w / 4 * mu0 / (mu0 + mu)
    np.testing.assert_allclose(hapke(mu0, mu, np.array([0.5, 0.2]), surface), expected, rtol=1e-5)


def test_roughness_darkens_oblique_views_most() -> None:
    angles = np.radians([10.0, 70.0])
    mu, cos_phase = np.cos(angles), np.cos(2 * angles)  # Sun and spacecraft on opposite sides of the normal
    rough, smooth = (hapke(mu, mu, cos_phase, HapkeSurface(theta_deg=theta)) for theta in (20.0, 0.0))
    steep, oblique = rough / smooth
    print(f"a surface of 20-deg slopes is {steep:.3f} times as bright at 10 deg, {oblique:.3f} at 70 deg")
    assert 0.85 < steep < 1
    assert oblique < 0.6 * steep


@pytest.mark.parametrize("camera", sorted(simulated_cameras()))
def test_offsets_have_the_papers_mean_smallest_and_largest(camera: str) -> None:
    along = simulated_cameras()[camera].offset_px.x
    rng = np.random.default_rng(1)
    draws = [exponential_between(rng, *along) for _ in range(2000)]
    assert np.mean(draws) == pytest.approx(along.mean, rel=0.08)
    assert min(draws) >= along.smallest
    assert max(draws) <= along.largest


def test_fields_have_unit_spread_and_every_purpose_of_every_product_its_own_numbers() -> None:
    unit = np.random.default_rng(0).standard_normal((20000, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    spreads = [SmoothField(generator(seed, "A", "field"), 1, 12)(unit).std() for seed in range(20)]
    assert np.mean(spreads) == pytest.approx(1, abs=0.15)
    draws = {generator(1, product, purpose).uniform() for product in "AB" for purpose in ("noise", "errors")}
    assert len(draws) == 4


def test_mismatched_surfaces_use_every_law_and_vary_with_the_place() -> None:
    surfaces = [mismatched_surface(np.random.default_rng(seed), uniform_map()) for seed in range(30)]
    assert {surface.law for surface in surfaces} == set(MISMATCHED)
    east_west = np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    cosine = np.full(2, 0.8)
    for surface in surfaces:
        east, west = surface.brightness(east_west, cosine, cosine, np.full(2, 0.5))
        assert east > 0
        assert east != west


def test_night_and_the_far_side_are_dark() -> None:
    surface = TrueSurface("mixture", {"lambert": 0.5, "lommel-seeliger": 0.5}, uniform_map())
    unit = np.tile([0.0, 0.0, 1.0], (3, 1))
    values = surface.brightness(unit, np.array([0.5, 0.0, 0.5]), np.array([0.5, 0.5, 0.0]), np.full(3, 0.3))
    assert values[0] > 0
    assert values[1:].tolist() == [0, 0]
