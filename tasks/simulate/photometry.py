"""Photometric laws: reflectance of a surface of unit albedo, relative, from the cosines of incidence and emission."""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from catalog.choice import Choice
from catalog.plugins import LAWS as GROUP
from catalog.plugins import Plugin, plugin_named

Array = NDArray[np.float32]
Law = Callable[[Array, Array, float], Array]


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


def _minnaert_half(mu0: Array, mu: Array, phase_deg: float) -> Array:  # noqa: ARG001
    """mu0^k mu^(k-1) with k = 1/2 (Minnaert 1941, Astrophys. J. 93, 403): bright at the limb."""
    return np.sqrt(mu0 / np.maximum(mu, np.float32(1e-3)))


LAWS: dict[str, Law] = {
    "lambert": lambert,
    "lommel-seeliger": lommel_seeliger,
    "lunar-lambert": lunar_lambert,
    "mu0-mu": _mu0_mu,
    "mu0-squared": _mu0_squared,
    "minnaert-half": _minnaert_half,
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
