"""Photometric laws against values of another implementation, against the literature's equations written out once more
for one place at a time, and against what they must be at special angles; and the limits and priors of a fit."""

import math

import numpy as np
import pytest

from catalog.errors import RefusedError, WrongOptionError
from tasks.photometry.fit import FitSettings, fit_law
from tasks.photometry.laws import LAWS, STANDARD_GEOMETRY_DEG, find_law
from tasks.photometry.region import RegionPixels
from tasks.photometry.regions import bound_values, held_values, prior_values

# Radiance factors of refmod 1.0.0 (MIT licence): anisotropic multiple scattering with both opposition effects, in
# double precision, 121 terms of the Legendre series. Columns: incidence, emission, azimuth (degrees), w, b, c, mean
# slope, B0, h, Bc0, hc, I/F. Smooth or nearly so: refmod leaves the azimuth out of one of the two denominators of the
# roughness (Hapke 1984, equations 47 and 50), which matters on steeper slopes; those are tested against the equations.
TABLE = """
17.554051 20.47122 142.42176 0.364007 -0.251594 0.239526 2.159739 0 0.031598 0 0.056507 0.080463137653
35.588986 47.770289 131.38378 0.950262 -0.19947 0.324274 0 0.726594 0.065617 0.100745 0.097611 0.445368081081
17.629073 26.490908 158.15773 0.620491 -0.370647 0.015173 2.706965 0.436819 0.027262 0.43025 0.093832 0.193971150695
18.160911 51.147036 54.880378 0.804395 -0.352758 0.109358 0 0.846898 0.134954 0 0.083807 0.378248443693
5.557998 61.179026 155.85555 0.877842 -0.237875 0.239842 2.146335 0 0.065476 0.53557 0.034784 0.379744421066
45.821158 33.173185 109.64625 0.433715 -0.163101 0.37343 0 0.777001 0.117726 0.56054 0.02852 0.075867117583
18.592318 15.18101 170.79824 0.712681 -0.439696 0.393516 2.789917 0.148684 0.080164 0 0.027417 0.240833464390
18.681625 68.974071 25.055366 0.501795 -0.272496 0.42473 0 0.968708 0.144548 0.206844 0.059048 0.157969397247
12.207046 6.046837 121.29985 0.700996 -0.334337 0.334564 2.52305 0 0.047648 0.347594 0.021287 0.253868897986
39.498266 43.827104 137.69424 0.567692 -0.10686 0.263875 0 0.284709 0.150839 0 0.044243 0.120223079063
11.700493 32.651695 63.700174 0.626921 -0.132652 0.273374 2.921427 0.60663 0.151343 0.57357 0.08579 0.193408555432
60.032495 65.426772 145.70419 0.472554 -0.268687 0.171358 0 0.33556 0.118595 0.258943 0.065679 0.068084983498
12.746372 10.14312 79.980671 0.780524 -0.130846 0.084479 2.512597 0 0.136416 0 0.02775 0.258100304329
74.683943 21.023926 28.589189 0.490328 -0.218904 0.112558 0 0.582685 0.188017 0.163009 0.047365 0.048112399343
6.590924 71.007769 176.96573 0.665362 -0.40842 0.026515 2.588293 0.25652 0.155888 0.568816 0.058446 0.176274291682
2.699385 7.011525 75.332135 0.876167 -0.182868 0.334569 0 0.464777 0.060379 0 0.037743 0.404122950129
22.597964 61.694204 89.164784 0.651084 -0.15599 0.221849 2.872765 0 0.193315 0.100574 0.040633 0.190574733753
61.985912 55.519775 100.61028 0.751345 -0.406751 0.341776 0 0.592506 0.116869 0.433188 0.039152 0.131728833189
15.005628 49.970649 139.74848 0.318366 -0.287923 0.428844 2.640019 0.679125 0.08428 0 0.074702 0.062104071893
8.066678 69.582263 155.47445 0.954462 -0.147487 0.057689 0 0.90462 0.086214 0.23518 0.044399 0.557157052208
19.501269 14.596504 87.766517 0.790125 -0.104292 0.405448 2.43418 0 0.116849 0.240068 0.089805 0.247326075690
18.546566 44.331944 32.239256 0.718959 -0.415667 0.441318 0 0.221212 0.128725 0 0.028025 0.283073840240
14.279446 57.626105 131.42985 0.734261 -0.334122 0.176561 2.652074 0.61968 0.142503 0.355823 0.040279 0.232780346840
35.883373 73.951984 35.634622 0.400846 -0.104254 0.426073 0 0.989783 0.054929 0.233049 0.027853 0.107912954046
"""
REFMOD = [tuple(map(float, line.split())) for line in TABLE.split("\n") if line]
NAMES = ("w", "b", "c", "theta_deg", "b0", "h", "bc0", "hc")


def phase_of(incidence: float, emission: float, azimuth: float) -> float:
    i, e, a = (math.radians(x) for x in (incidence, emission, azimuth))
    return math.degrees(math.acos(math.cos(i) * math.cos(e) + math.sin(i) * math.sin(e) * math.cos(a)))


def reflectance(law: str, values, incidence: float, emission: float, phase: float) -> float:
    mu0, mu = (np.array([math.cos(math.radians(x))]) for x in (incidence, emission))
    return float(find_law(law).reflectance(values, mu0, mu, np.array([phase]))[0])


@pytest.mark.parametrize("row", REFMOD, ids=lambda row: f"i{row[0]:.0f}e{row[1]:.0f}")
def test_hapke_2002_is_that_of_another_implementation(row) -> None:
    incidence, emission, azimuth, *values, expected = row
    found = reflectance(
        "hapke-2002", dict(zip(NAMES, values, strict=True)), incidence, emission, phase_of(incidence, emission, azimuth)
    )
    assert found == pytest.approx(expected, rel=1e-6)


def hapke_2012_by_hand(v, incidence: float, emission: float, azimuth: float) -> float:
    """One place, by Hapke (2012), equations 7.45-7.50, 8.56, 9.22, 9.43, 12.45-12.55; written without numpy."""
    i, e, psi = (math.radians(x) for x in (incidence, emission, azimuth))
    t = math.tan(math.radians(v["theta_deg"]))
    chi = 1 / math.sqrt(1 + math.pi * t * t)

    def e1(x: float) -> float:
        return math.exp(-2 / math.pi / t / math.tan(x))

    def e2(x: float) -> float:
        return math.exp(-1 / math.pi / t**2 / math.tan(x) ** 2)

    def eta(x: float) -> float:
        return chi * (math.cos(x) + math.sin(x) * t * e2(x) / (2 - e1(x)))

    s2, c = math.sin(psi / 2) ** 2, math.cos(psi)
    f = math.exp(-2 * math.tan(psi / 2))
    if i <= e:
        low = 2 - e1(e) - psi / math.pi * e1(i)
        mu0 = chi * (math.cos(i) + math.sin(i) * t * (c * e2(e) + s2 * e2(i)) / low)
        mu = chi * (math.cos(e) + math.sin(e) * t * (e2(e) - s2 * e2(i)) / low)
        shade = mu / eta(e) * math.cos(i) / eta(i) * chi / (1 - f + f * chi * math.cos(i) / eta(i))
    else:
        low = 2 - e1(i) - psi / math.pi * e1(e)
        mu0 = chi * (math.cos(i) + math.sin(i) * t * (e2(i) - s2 * e2(e)) / low)
        mu = chi * (math.cos(e) + math.sin(e) * t * (c * e2(i) + s2 * e2(e)) / low)
        shade = mu / eta(e) * math.cos(i) / eta(i) * chi / (1 - f + f * chi * math.cos(e) / eta(e))
    part = 1.209 * v["filling"] ** (2 / 3)
    k = -math.log(1 - part) / part
    r0 = (1 - math.sqrt(1 - v["w"])) / (1 + math.sqrt(1 - v["w"]))

    def h(x: float) -> float:
        return 1 / (1 - v["w"] * x * (r0 + (1 - 2 * r0 * x) / 2 * math.log((1 + x) / x)))

    g = math.radians(phase_of(incidence, emission, azimuth))
    b = v["b"]
    particle = (1 - b * b) * (
        (1 - v["c"]) / (1 + 2 * b * math.cos(g) + b * b) ** 1.5 + v["c"] / (1 - 2 * b * math.cos(g) + b * b) ** 1.5
    )
    hidden = v["b0"] / (1 + math.tan(g / 2) / v["h"])
    x = math.tan(g / 2) / v["hc"]
    coherent = 1 + v["bc0"] * (1 + (1 - math.exp(-x)) / x) / (2 * (1 + x) ** 2)
    often = h(mu0 / k) * h(mu / k) - 1
    return k * v["w"] / 4 * mu0 / (mu0 + mu) * (particle * (1 + hidden) + often) * shade * coherent


@pytest.mark.parametrize("row", REFMOD[::2], ids=lambda row: f"i{row[0]:.0f}e{row[1]:.0f}")
@pytest.mark.parametrize(("filling", "theta_deg"), [(0.05, 3.0), (0.3, 14.0), (0.6, 35.0)])
def test_hapke_2012_is_that_of_the_book(row, filling: float, theta_deg: float) -> None:
    incidence, emission, azimuth, *given, _ = row
    values = dict(zip(NAMES, given, strict=True)) | {"filling": filling, "theta_deg": theta_deg}
    found = reflectance("hapke-2012", values, incidence, emission, phase_of(incidence, emission, azimuth))
    assert found == pytest.approx(hapke_2012_by_hand(values, incidence, emission, azimuth), rel=1e-6)


@pytest.mark.parametrize("row", REFMOD[1::3], ids=lambda row: f"i{row[0]:.0f}e{row[1]:.0f}")
@pytest.mark.parametrize("law", ["lambert", "lommel-seeliger", "lunar-lambert", "mcewen", "minnaert", "akimov"])
def test_disk_laws_are_those_of_the_literature(row, law: str) -> None:
    """Akimov's as Shkuratov et al. (2011) print it in terms of incidence, emission and azimuth."""
    incidence, emission, azimuth = row[:3]
    phase = phase_of(incidence, emission, azimuth)
    i, e, g = (math.radians(x) for x in (incidence, emission, phase))
    mu0, mu = math.cos(i), math.cos(e)
    values = {
        "albedo": 0.7, "mag_per_deg": 0.02, "limb_weight": 0.8, "limb_weight_per_deg": -0.006, "k": 0.55,
        "k_per_deg": 0.003, "nu": 0.52,
    }  # fmt: skip
    moon = min(max(1 - 0.019 * phase + 2.42e-4 * phase**2 - 1.46e-6 * phase**3, 0), 1)
    share = 0.8 - 0.006 * phase
    k = 0.55 + 0.003 * phase
    # photometric latitude and longitude from sines and cosines of i, e, g
    cos_b2 = (math.sin(i + e) ** 2 - math.cos(math.radians(azimuth) / 2) ** 2 * math.sin(2 * e) * math.sin(2 * i)) / (
        math.sin(i + e) ** 2
        - math.cos(math.radians(azimuth) / 2) ** 2 * math.sin(2 * e) * math.sin(2 * i)
        + math.sin(e) ** 2 * math.sin(i) ** 2 * math.sin(math.radians(azimuth)) ** 2
    )
    cos_b = math.sqrt(cos_b2)
    cos_l = mu / cos_b
    # the sign of the longitude: the Sun's side of the mirror meridian or the other
    sine = (mu0 - math.cos(g) * mu) / math.sin(g) / cos_b
    longitude = math.atan2(sine, cos_l)
    expected = {
        "lambert": mu0,
        "lommel-seeliger": 2 * mu0 / (mu0 + mu),
        "lunar-lambert": share * 2 * mu0 / (mu0 + mu) + (1 - share) * mu0,
        "mcewen": moon * 2 * mu0 / (mu0 + mu) + (1 - moon) * mu0,
        "minnaert": mu0**k * mu ** (k - 1),
        "akimov": math.cos(g / 2) * math.cos(math.pi / (math.pi - g) * (longitude - g / 2))
        * cos_b ** (0.52 * g / (math.pi - g)) / cos_l,
    }[law]  # fmt: skip
    expected *= 0.7 * 10 ** (-0.4 * 0.02 * phase)
    assert reflectance(law, values, incidence, emission, phase) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
def test_a_law_normalises_its_own_brightness_to_the_standard_geometry(law: str) -> None:
    chosen = find_law(law)
    values = chosen.usual_values
    rng = np.random.default_rng(1)
    incidence, emission = rng.uniform(1, 75, (2, 200))
    low, high = np.abs(incidence - emission), np.minimum(incidence + emission, 175)
    phase = low + (high - low) * rng.uniform(0.02, 0.98, 200)
    seen = chosen.reflectance(values, np.cos(np.radians(incidence)), np.cos(np.radians(emission)), phase)
    assert (seen > 0).all()
    factor = chosen.normalising_factor(values, incidence, emission, phase)
    i, e, g = STANDARD_GEOMETRY_DEG
    assert seen * factor == pytest.approx(np.full(200, reflectance(law, values, i, e, g)), rel=1e-9)
    dark = chosen.normalising_factor(values, [95.0, 10.0], [10.0, 91.0], [95.0, 95.0])
    assert not np.isfinite(dark).any()


def pixels_of(law: str, values, units: float = 1.0, seed: int = 4) -> RegionPixels:
    """Six images of a surface of one law, 2 % noise."""
    rng = np.random.default_rng(seed)
    n = 1500
    image = np.repeat(np.arange(6), n // 6)
    phase = np.array([3.0, 12, 30, 50, 75, 95])[image]
    incidence, emission = rng.uniform(0, 70, (2, 20 * n))
    drawn = zip(incidence, emission, rng.uniform(0, 180, 20 * n), strict=True)
    drawn_phase = np.array([phase_of(*each) for each in drawn])
    near = [int(np.argmin(np.abs(drawn_phase - p) + rng.uniform(0, 3, 20 * n))) for p in phase]
    mu0, mu = np.cos(np.radians(incidence[near])), np.cos(np.radians(emission[near]))
    phase = drawn_phase[near]
    value = units * find_law(law).reflectance(values, mu0, mu, phase) * (1 + rng.normal(0, 0.02, n))
    products = tuple(f"I{k}" for k in range(6))
    return RegionPixels(products, image, value, mu0, mu, phase, np.ones(n), rng.integers(0, 200, n), (n // 6,) * 6)


@pytest.mark.parametrize("law", ["lambert", "lommel-seeliger", "mcewen", "minnaert", "akimov"])
def test_a_fit_finds_planted_parameters_and_albedo_in_reflectance_when_the_scale_is_known(law: str) -> None:
    values = find_law(law).usual_values | {"albedo": 0.6, "mag_per_deg": 0.015}
    pixels = pixels_of(law, values, units=2000.0)
    fit = fit_law(find_law(law), pixels, FitSettings(calibration_sigma=0.0, units_per_if=2000.0))
    assert fit.absolute
    for name in fit.names:
        assert abs(fit.values[name] - values[name]) < 4 * fit.sigma[name] + 1e-9, name
    bare = fit_law(find_law(law), pixels, FitSettings(calibration_sigma=0.0))
    assert not bare.absolute
    assert bare.values["albedo"] == pytest.approx(2000 * fit.values["albedo"], rel=1e-3)


def test_priors_and_limits_hold_what_they_are_given_for() -> None:
    values = find_law("hapke").usual_values | {"w": 0.8, "b0": 0.4, "h": 0.03}
    pixels = pixels_of("hapke", values)
    law = find_law("hapke")
    free = fit_law(law, pixels, FitSettings(calibration_sigma=0.0, units_per_if=1.0))
    held = fit_law(law, pixels, FitSettings(0.0, 1.0, priors={"w": (0.7, 1e-5)}))
    assert held.values["w"] == pytest.approx(0.7, abs=1e-3)
    assert abs(free.values["w"] - 0.8) < 4 * free.sigma["w"]
    limited = fit_law(law, pixels, FitSettings(0.0, 1.0, bounds={"theta_deg": (20.0, 30.0)}))
    assert "theta_deg" in limited.at_bound
    assert limited.values["theta_deg"] == pytest.approx(20.0, abs=0.01)
    wide = fit_law(law, pixels, FitSettings(0.0, 1.0, priors={"w": (0.7, 100.0)}))
    assert wide.values["w"] == pytest.approx(free.values["w"], abs=0.2 * free.sigma["w"] + 1e-4)
    for wrong in ({"priors": {"zeal": (1.0, 1.0)}}, {"bounds": {"zeal": (0.0, 1.0)}}):
        with pytest.raises(RefusedError, match="has no zeal"):
            fit_law(law, pixels, FitSettings(0.0, 1.0, **wrong))


def test_the_filling_factor_is_solved_only_with_a_prior() -> None:
    law = find_law("hapke-2012")
    pixels = pixels_of("hapke-2012", law.usual_values)
    settings = {"calibration_sigma": 0.0, "units_per_if": 1.0, "held": {"bc0": 0.2, "hc": 0.01, "b0": 0.5, "h": 0.002}}
    assert fit_law(law, pixels, FitSettings(**settings)).held["filling"] == 0
    found = fit_law(law, pixels, FitSettings(**settings, priors={"filling": (0.1, 0.02)}))
    assert abs(found.values["filling"] - 0.1) < 0.06


def test_what_users_write_of_parameters_is_read_or_refused() -> None:
    assert held_values(["w=0.9"]) == {"w": 0.9}
    assert prior_values(["w=0.9+-0.05"]) == {"w": (0.9, 0.05)}
    assert bound_values(["b=-0.5:0.1"]) == {"b": (-0.5, 0.1)}
    for read, wrong in (
        (held_values, "w"), (held_values, "w=nan"), (prior_values, "w=0.9"), (prior_values, "w=0.9+-0"),
        (bound_values, "w=1:0"), (bound_values, "w=1"), (prior_values, "w=x+-1"),
    ):  # fmt: skip
        with pytest.raises(WrongOptionError):
            read([wrong])
