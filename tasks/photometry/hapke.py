"""Hapke's bidirectional reflectance of a rough surface, vectorised over the places of a disk."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LEGENDRE_TERMS = 40  # leaves out 1e-6 of the sum for asymmetries of up to 0.7


@dataclass(frozen=True)
class HapkeSurface:
    """w: single-scattering albedo; b, c: double-lobed Henyey-Greenstein particle phase function; b0, h: amplitude and
    width of the opposition effect by shadow hiding; theta_deg: mean slope; bc0, hc: amplitude and width of that by
    coherent backscatter; filling: share of the volume that particles fill, 0 for a loose surface.

    Default: Europa at 0.55 micrometres (Domingue et al. 1991, Icarus 90, 30: w 0.964, B0 0.5, h 0.0016, b -0.429,
    c 0.113, 10 deg)."""

    w: float = 0.964
    b: float = -0.429
    c: float = 0.113
    b0: float = 0.5
    h: float = 0.0016
    theta_deg: float = 10.0
    bc0: float = 0.0
    hc: float = 0.05
    filling: float = 0.0

    @property
    def porosity_factor(self) -> float:
        """K = -ln(1 - 1.209 f^(2/3)) / (1.209 f^(2/3)) of the filling factor f (Hapke 2008, Icarus 195, 918)."""
        part = 1.209 * self.filling ** (2 / 3)
        return float(-np.log1p(-part) / part) if part > 0 else 1.0


def hapke(
    mu0: Array,
    mu: Array,
    cos_phase: Array,
    surface: HapkeSurface,
    w: Array | None = None,
    exact_h: bool = False,
    anisotropic: bool = False,
) -> Array:
    """Radiance factor I/F (n,) for cosines of incidence, emission and phase (n,), lit and seen places only.

    w: single-scattering albedo of each place. exact_h: Chandrasekhar's H by Hapke's approximation of 2002 instead of
    that of 1981; anisotropic: multiple scattering by anisotropic particles. Hapke 1984, Icarus 59, 41: roughness; Hapke
    1981, J. Geophys. Res. 86, 3039: the rest; Hapke 2002, Icarus 157, 523: H function, anisotropic multiple scattering,
    coherent backscatter; Hapke 2012, Theory of Reflectance and Emittance Spectroscopy, 2nd edition: porosity.
    """
    albedo = np.full_like(mu0, surface.w) if w is None else w
    mu0_effective, mu_effective, shadowing = _roughness(mu0, mu, cos_phase, np.radians(surface.theta_deg))
    half_tangent = np.tan(np.arccos(np.clip(cos_phase, -1, 1)) / 2)
    hidden = surface.b0 / (1 + half_tangent / surface.h)
    once = (1 + hidden) * _particle_phase(cos_phase, surface)
    often = _multiple_scattering(mu0_effective, mu_effective, albedo, surface, exact_h, anisotropic)
    weight = surface.porosity_factor * mu0_effective / np.maximum(mu0_effective + mu_effective, 1e-9)
    coherent = 1 + surface.bc0 * _coherent(half_tangent / surface.hc) if surface.bc0 else 1.0
    return np.asarray(albedo / 4 * weight * (once + often) * shadowing * coherent)


def _coherent(x: Array) -> Array:
    """Angular shape of coherent backscatter, 1 at x = 0 (Hapke 2002, equation 32)."""
    safe = np.maximum(x, 1e-12)
    return np.asarray((1 - np.expm1(-safe) / safe) / 2 / (1 + x) ** 2)


def _multiple_scattering(
    mu0: Array, mu: Array, w: Array, surface: HapkeSurface, exact_h: bool, anisotropic: bool
) -> Array:
    """What is scattered more than once, relative to w / 4 mu0 / (mu0 + mu)."""
    k = surface.porosity_factor
    h0, h = (_chandrasekhar(x / k, w, exact_h) for x in (mu0, mu))
    if not anisotropic:
        return np.asarray(h0 * h - 1)
    of_sun, of_camera, of_both = _legendre_series(mu0, mu, surface)
    return np.asarray(of_sun * (h - 1) + of_camera * (h0 - 1) + of_both * (h - 1) * (h0 - 1))


def _chandrasekhar(x: Array, w: Array, exact: bool) -> Array:
    """H(x), to 4 % (Hapke 1981) or 1 % (Hapke 2002, equation 13)."""
    gamma = np.sqrt(1 - w)
    if not exact:
        return np.asarray((1 + 2 * x) / (1 + 2 * x * gamma))
    r0 = (1 - gamma) / (1 + gamma)
    safe = np.maximum(x, 1e-12)
    return np.asarray(1 / (1 - w * x * (r0 + (1 - 2 * r0 * x) / 2 * np.log1p(1 / safe))))


def _legendre_series(mu0: Array, mu: Array, surface: HapkeSurface) -> tuple[Array, Array, float]:
    """P(mu0), P(mu) and P of Hapke 2002, equations 23 to 27, of the particle phase function."""
    order = np.arange(LEGENDRE_TERMS)
    a = np.zeros(LEGENDRE_TERMS)
    a[1] = -0.5
    for n in range(3, LEGENDRE_TERMS, 2):
        a[n] = (2 - n) / (n + 1) * a[n - 2]
    b = (2 * order + 1) * ((1 - surface.c) * (-surface.b) ** order + surface.c * surface.b**order)
    of_sun, of_camera = (1 + np.asarray(np.polynomial.legendre.legval(x, a * b), np.float64) for x in (mu0, mu))
    return of_sun, of_camera, float(1 + (a**2 * b).sum())


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
