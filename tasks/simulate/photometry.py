"""Photometric laws: reflectance of a surface of unit albedo, relative, from the cosines of incidence and emission."""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from catalog.choice import Choice
from catalog.plugins import LAWS as GROUP
from catalog.plugins import Plugin, plugin_named
from tasks.compiled import compiled_reordered

Array = NDArray[np.float32]
Law = Callable[[Array, Array, float], Array]
# Cosines are taken for no smaller where laws divide by them.
LEAST_COSINE = np.float32(1e-3)
# Entries of the tables of functions that are slow to compute.
TABLE = 2049


def lambert(mu0: Array, mu: Array, phase_deg: float) -> Array:  # noqa: ARG001 - one signature for all laws
    """mu0."""
    return mu0


def lommel_seeliger(mu0: Array, mu: Array, phase_deg: float) -> Array:  # noqa: ARG001
    """2 mu0 / (mu0 + mu), the single scattering of a dark particulate surface (Hapke 1981, J. Geophys. Res. 86)."""
    return np.float32(2) * mu0 / np.maximum(mu0 + mu, np.float32(1e-6))


def lunar_lambert_weight(phase_deg: float) -> float:
    """Weight L of the Lommel-Seeliger term by phase angle, degrees (McEwen 1996, LPSC XXVII, 841; the Moon)."""
    a = min(max(phase_deg, 0.0), 130.0)
    return float(np.clip(1 - 0.019 * a + 2.42e-4 * a**2 - 1.46e-6 * a**3, 0, 1))


def lunar_lambert(mu0: Array, mu: Array, phase_deg: float) -> Array:
    """L 2 mu0 / (mu0 + mu) + (1 - L) mu0 (McEwen 1991, Icarus 92, 298)."""
    weight = np.float32(lunar_lambert_weight(phase_deg))
    return weight * lommel_seeliger(mu0, mu, phase_deg) + (1 - weight) * mu0


def _mu0_mu(mu0: Array, mu: Array, phase_deg: float) -> Array:  # noqa: ARG001
    return mu0 * mu


def _mu0_squared(mu0: Array, mu: Array, phase_deg: float) -> Array:  # noqa: ARG001
    return mu0 * mu0


def _of_day(mu0: Array) -> Array:
    """Without what rounding leaves below 0 at the terminator: reordered sums give cosines of -1e-18, whose root is no
    number."""
    return np.maximum(mu0, np.float32(0))


def _minnaert_half(mu0: Array, mu: Array, phase_deg: float) -> Array:  # noqa: ARG001
    """mu0^k mu^(k-1) with k = 1/2 (Minnaert 1941, Astrophys. J. 93, 403): bright at the limb."""
    return np.sqrt(_of_day(mu0) / np.maximum(mu, LEAST_COSINE))


def _minnaert_three_quarters(mu0: Array, mu: Array, phase_deg: float) -> Array:  # noqa: ARG001
    """The same with k = 3/4: with k = 1/2 and Lambert's k = 1, exponents between come out right to 0.3 %."""
    root = np.sqrt(_of_day(mu0))
    return np.asarray(root * np.sqrt(root) / np.sqrt(np.sqrt(np.maximum(mu, LEAST_COSINE))), np.float32)


def akimov(mu0: Array, mu: Array, phase_deg: float) -> Array:
    """Akimov's disk function without parameters (Shkuratov et al. 2011, Planet. Space Sci. 59, 1326, equation 19), by
    photometric latitude and longitude: of surfaces that are rough at all scales. By tables, right to 1e-4, near the
    terminator to 1e-2."""
    phase = float(np.radians(np.clip(phase_deg, 0.1, 179.0)))
    from_limb = np.pi - 2 * np.arcsin(np.linspace(0, 1, TABLE))
    stretch = np.pi / (np.pi - phase)
    around = np.sin(stretch * from_limb) / np.maximum(np.sin(from_limb), 1e-9)
    around[-1] = stretch
    along = np.linspace(0, 1, TABLE).clip(0.25 / TABLE) ** (phase / (np.pi - phase))
    flat = (np.float32(values).ravel() for values in (mu0, mu))
    return np.asarray(_akimov(*flat, phase, np.maximum(around, 0), along).reshape(np.shape(mu0)))


@compiled_reordered
def _akimov(mu0, mu, phase, around, along):  # type: ignore[no-untyped-def]
    """around: by the sine of half of the photometric longitude from the terminator's side, 0 to 1; along: by the cosine
    of the latitude, 0 to 1."""
    out = np.zeros(len(mu0), np.float32)
    cos_phase, sin_phase, last = np.cos(phase), np.sin(phase), len(around) - 1
    for i in range(len(mu0)):
        if mu0[i] <= 0:
            continue
        emission = max(mu[i], 1e-3)
        across = mu0[i] / emission - cos_phase
        length = np.sqrt(across * across + sin_phase * sin_phase)
        x = np.sqrt(max(0.5 * (across / length + 1), 0.0)) * last
        y = min(emission * length / sin_phase, 1.0) * last
        j, k = min(int(x), last - 1), min(int(y), last - 1)
        by_longitude = around[j] + (x - j) * (around[j + 1] - around[j])
        out[i] = by_longitude * (along[k] + (y - k) * (along[k + 1] - along[k]))
    return out


LAWS: dict[str, Law] = {
    "lambert": lambert,
    "lommel-seeliger": lommel_seeliger,
    "lunar-lambert": lunar_lambert,
    "mu0-mu": _mu0_mu,
    "mu0-squared": _mu0_squared,
    "minnaert-half": _minnaert_half,
    "minnaert-three-quarters": _minnaert_three_quarters,
    "akimov": akimov,
}


def laws(names: Sequence[str]) -> tuple[Law, ...]:
    """The laws of these names, ours or a plugin's. Raises KeyError for an unknown one."""
    return tuple(LAWS[name] if name in LAWS else _plugged(name) for name in names)


def bases_of(name: str) -> tuple[Law, ...]:
    """The laws of a name of BASES; a plugin's law stands alone. Raises KeyError for an unknown one."""
    return BASES[name] if name in BASES else (_plugged(name),)


@cache
def _plugged(name: str) -> Law:
    """A plugin's law; what it gives is checked, and its faults name it."""
    plugin = plugin_named(GROUP, name)
    if plugin is None:
        raise KeyError(name)
    return _checked(plugin, plugin.load())


def _checked(plugin: Plugin, law: Law) -> Law:
    def checked(mu0: Array, mu: Array, phase_deg: float) -> Array:
        with plugin.guarded("fails"):
            reflectance = np.asarray(law(mu0, mu, phase_deg), dtype=np.float32)
        if reflectance.shape != mu0.shape or not np.isfinite(reflectance).all():
            raise plugin.fault(f"gives {reflectance.shape}, or numbers that are not finite, for cosines {mu0.shape}")
        return reflectance

    return checked


# One law is one basis image; a mixture leaves the image to say how much of each (DESIGN, what decides accuracy).
BASES: dict[str, tuple[Law, ...]] = {
    "lambert": (lambert,),
    "lommel-seeliger": (lommel_seeliger,),
    "lunar-lambert": (lunar_lambert,),
    "mixture": (lambert, lommel_seeliger, _mu0_mu, _mu0_squared),
}

LawName = Annotated[str, Choice("photometric law", GROUP, tuple(LAWS))]
BasisName = Annotated[str, Choice("photometry", GROUP, tuple(BASES))]
