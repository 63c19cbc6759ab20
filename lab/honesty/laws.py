"""Photometric laws of the rendered surfaces: radiance factor of incidence, emission and phase, up to a constant."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Below it the laws' exponents of cos(emission) would make single samples at the limb arbitrarily bright.
LEAST_COSINE = 0.01
LAWS = ("lambert", "lommel-seeliger", "lunar-lambert", "minnaert", "hapke", "akimov")


def radiance(law: str, parameters: Mapping[str, float], mu0: Array, mu: Array, phase_rad: Array) -> Array:
    """Radiance factor (any shape) for cosines of incidence and emission, both positive on what is lit and seen, and
    the phase angle in radians; 0 where mu0 <= 0. Raises KeyError for an unknown law or a missing parameter."""
    lit = mu0 > 0
    mu0, mu = np.clip(mu0, 1e-6, 1.0), np.clip(mu, LEAST_COSINE, 1.0)
    return np.where(lit, _LAWS[law](parameters, mu0, mu, phase_rad), 0.0)


def lambert(_: Mapping[str, float], mu0: Array, mu: Array, phase_rad: Array) -> Array:  # noqa: ARG001
    """mu0."""
    return mu0


def lommel_seeliger(_: Mapping[str, float], mu0: Array, mu: Array, phase_rad: Array) -> Array:  # noqa: ARG001
    """mu0 / (mu0 + mu)."""
    return mu0 / (mu0 + mu)


def lunar_lambert(_: Mapping[str, float], mu0: Array, mu: Array, phase_rad: Array) -> Array:
    """2 L mu0 / (mu0 + mu) + (1 - L) mu0, L of the phase angle by McEwen (1991, Icarus 92, 298), for the Moon."""
    g = np.degrees(phase_rad)
    share = np.clip(1.0 - 0.019 * g + 2.42e-4 * g**2 - 1.46e-6 * g**3, 0.0, 1.0)
    return 2 * share * mu0 / (mu0 + mu) + (1 - share) * mu0


def minnaert(parameters: Mapping[str, float], mu0: Array, mu: Array, phase_rad: Array) -> Array:  # noqa: ARG001
    """mu0^k mu^(k - 1) (Minnaert 1941, ApJ 93, 403)."""
    k = parameters["k"]
    return np.asarray(mu0**k * mu ** (k - 1))


def akimov(_: Mapping[str, float], mu0: Array, mu: Array, phase_rad: Array) -> Array:
    """Akimov's parameterless disk function (Shkuratov et al. 2011, Planet. Space Sci. 59, 1326, equation 19), of
    photometric latitude and longitude."""
    g = np.clip(phase_rad, 1e-4, np.pi - 1e-4)
    longitude = np.arctan2(mu0 / mu - np.cos(g), np.sin(g))
    cos_longitude = np.maximum(np.cos(longitude), LEAST_COSINE)
    cos_latitude = np.clip(mu / cos_longitude, 1e-6, 1.0)
    turned = np.pi / (np.pi - g) * (longitude - g / 2)
    disk = np.cos(g / 2) * np.cos(turned) * cos_latitude ** (g / (np.pi - g)) / cos_longitude
    return np.maximum(disk, 0.0)


def hapke(parameters: Mapping[str, float], mu0: Array, mu: Array, phase_rad: Array) -> Array:
    """Hapke's bidirectional reflectance with macroscopic roughness (Hapke 1984, Icarus 59, 41; 1993, equations 8.89
    and 12.46-12.55). parameters: w (albedo), b (asymmetry of a Henyey-Greenstein function, negative backward), b0 and h
    (opposition effect), roughness_deg."""
    w, roughness = parameters["w"], np.radians(parameters["roughness_deg"])
    mu0_e, mu_e, shadowing = rough(mu0, mu, phase_rad, float(roughness))
    b, cos_g = parameters["b"], np.cos(phase_rad)
    particle = (1 - b**2) / (1 + 2 * b * cos_g + b**2) ** 1.5
    surge = parameters["b0"] / (1 + np.tan(np.clip(phase_rad, 0, np.pi - 1e-3) / 2) / parameters["h"])
    gamma = np.sqrt(1 - w)
    multiple = (1 + 2 * mu0_e) / (1 + 2 * mu0_e * gamma) * (1 + 2 * mu_e) / (1 + 2 * mu_e * gamma) - 1
    return np.asarray(w / 4 * mu0_e / (mu0_e + mu_e) * ((1 + surge) * particle + multiple) * shadowing)


def rough(mu0: Array, mu: Array, phase_rad: Array, roughness_rad: float) -> tuple[Array, Array, Array]:
    """Effective cosines of incidence and emission, and the shadowing function, for a mean slope of `roughness_rad`."""
    if roughness_rad <= 0:
        return mu0, mu, np.ones_like(mu0)
    tangent = np.tan(roughness_rad)
    chi = 1 / np.sqrt(1 + np.pi * tangent**2)
    sin_i, sin_e = np.sqrt(1 - mu0**2), np.sqrt(1 - mu**2)
    azimuth = (np.cos(phase_rad) - mu0 * mu) / np.maximum(sin_i * sin_e, 1e-9)
    psi = np.arccos(np.clip(azimuth, -1, 1))
    half, cos_psi = np.sin(psi / 2) ** 2, np.cos(psi)
    cot_i, cot_e = mu0 / np.maximum(sin_i, 1e-9), mu / np.maximum(sin_e, 1e-9)
    e1_i, e1_e = (np.exp(-2 / np.pi / tangent * cot) for cot in (cot_i, cot_e))
    e2_i, e2_e = (np.exp(-1 / np.pi / tangent**2 * cot**2) for cot in (cot_i, cot_e))
    eta_i = chi * (mu0 + sin_i * tangent * e2_i / (2 - e1_i))
    eta_e = chi * (mu + sin_e * tangent * e2_e / (2 - e1_e))
    steep = mu0 < mu  # i > e
    less = 2 - np.where(steep, e1_i + psi / np.pi * e1_e, e1_e + psi / np.pi * e1_i)
    own, other = np.where(steep, e2_i, e2_e), np.where(steep, e2_e, e2_i)
    direct, mixed = own - half * other, cos_psi * own + half * other
    mu0_e = chi * (mu0 + sin_i * tangent * np.where(steep, direct, mixed) / less)
    mu_e = chi * (mu + sin_e * tangent * np.where(steep, mixed, direct) / less)
    seen = np.exp(-2 * np.tan(np.minimum(psi, np.pi - 1e-3) / 2))
    smaller = np.where(steep, mu / eta_e, mu0 / eta_i)
    shadowing = mu_e / eta_e * mu0 / eta_i * chi / (1 - seen + seen * chi * smaller)
    return np.maximum(mu0_e, 1e-6), np.maximum(mu_e, 1e-6), shadowing


_LAWS = {
    "lambert": lambert,
    "lommel-seeliger": lommel_seeliger,
    "lunar-lambert": lunar_lambert,
    "minnaert": minnaert,
    "hapke": hapke,
    "akimov": akimov,
}
