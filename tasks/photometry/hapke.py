"""Hapke's bidirectional reflectance of a rough surface, vectorised over the places of a disk."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HapkeSurface:
    """w: single-scattering albedo; b, c: double-lobed Henyey-Greenstein particle phase function; b0, h: amplitude and
    width of the opposition effect; theta_deg: mean slope. Default: Europa at 0.55 micrometres (Domingue et al. 1991,
    Icarus 90, 30: w 0.964, B0 0.5, h 0.0016, b -0.429, c 0.113, 10 deg)."""

    w: float = 0.964
    b: float = -0.429
    c: float = 0.113
    b0: float = 0.5
    h: float = 0.0016
    theta_deg: float = 10.0


def hapke(mu0: Array, mu: Array, cos_phase: Array, surface: HapkeSurface, w: Array | None = None) -> Array:
    """Reflectance (n,) for cosines of incidence, emission and phase (n,), lit and seen places only.

    w: single-scattering albedo of each place. Hapke 1984, Icarus 59, 41: roughness; Hapke 1981, J. Geophys. Res. 86,
    3039: the rest.
    """
    albedo = np.full_like(mu0, surface.w) if w is None else w
    mu0_effective, mu_effective, shadowing = _roughness(mu0, mu, cos_phase, np.radians(surface.theta_deg))
    phase = np.arccos(np.clip(cos_phase, -1, 1))
    opposition = surface.b0 / (1 + np.tan(phase / 2) / surface.h)
    gamma = np.sqrt(1 - albedo)

    def multiple(x: Array) -> Array:
        return np.asarray((1 + 2 * x) / (1 + 2 * x * gamma))

    once = (1 + opposition) * _particle_phase(cos_phase, surface)
    often = multiple(mu0_effective) * multiple(mu_effective) - 1
    weight = mu0_effective / np.maximum(mu0_effective + mu_effective, 1e-9)
    return np.asarray(albedo / 4 * weight * (once + often) * shadowing)


def _particle_phase(cos_phase: Array, surface: HapkeSurface) -> Array:
    """Domingue's form: (1 - c) (1 - b^2) / (1 + 2 b cos g + b^2)^1.5 + c (1 - b^2) / (1 - 2 b cos g + b^2)^1.5."""
    b, c = surface.b, surface.c
    first, second = (1 + sign * 2 * b * cos_phase + b * b for sign in (1, -1))
    return np.asarray((1 - b * b) * ((1 - c) / first**1.5 + c / second**1.5))


def _roughness(mu0: Array, mu: Array, cos_phase: Array, theta: float) -> tuple[Array, Array, Array]:
    """Effective cosines of incidence and emission, and the shadowing function."""
    if theta <= 0:
        return mu0, mu, np.ones_like(mu0)
    i, e = np.arccos(np.clip(mu0, 0, 1)), np.arccos(np.clip(mu, 0, 1))
    sin_i, sin_e = np.sin(i), np.sin(e)
    psi = np.arccos(np.clip((cos_phase - mu0 * mu) / np.maximum(sin_i * sin_e, 1e-9), -1, 1))
    tangent = np.tan(theta)
    chi = 1 / np.sqrt(1 + np.pi * tangent**2)

    def e1(x: Array) -> Array:
        return np.asarray(np.exp(-2 / np.pi / tangent / np.maximum(np.tan(x), 1e-9)))

    def e2(x: Array) -> Array:
        return np.asarray(np.exp(-1 / np.pi / tangent**2 / np.maximum(np.tan(x), 1e-9) ** 2))

    def eta(cosine: Array, sine: Array, x: Array) -> Array:
        return np.asarray(chi * (cosine + sine * tangent * e2(x) / (2 - e1(x))))

    low, high = np.minimum(i, e), np.maximum(i, e)
    share = np.sin(psi / 2) ** 2
    below = 2 - e1(high) - psi / np.pi * e1(low)
    # The smaller of the two angles takes the cos(psi) term (Hapke 1984, equations 46 to 51).
    for_low = chi * (np.cos(low) + np.sin(low) * tangent * (np.cos(psi) * e2(high) + share * e2(low)) / below)
    for_high = chi * (np.cos(high) + np.sin(high) * tangent * (e2(high) - share * e2(low)) / below)
    incidence_is_low = i <= e
    mu0_effective = np.where(incidence_is_low, for_low, for_high)
    mu_effective = np.where(incidence_is_low, for_high, for_low)
    eta_i, eta_e = eta(mu0, sin_i, i), eta(mu, sin_e, e)
    f = np.exp(-2 * np.tan(np.minimum(psi, np.pi - 1e-6) / 2))
    smaller = np.where(incidence_is_low, mu0 / eta_i, mu / eta_e)
    shadowing = mu_effective / eta_e * mu0 / eta_i * chi / (1 - f + f * chi * smaller)
    return np.maximum(mu0_effective, 0), np.maximum(mu_effective, 1e-6), shadowing
