"""Photometric laws: reflectance of a surface of unit albedo, relative, from the cosines of incidence and emission."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

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
    """The laws of these names."""
    return tuple(LAWS[name] for name in names)


# One law is one basis image; a mixture leaves the image to say how much of each (DESIGN, what decides accuracy).
BASES: dict[str, tuple[Law, ...]] = {
    "lambert": (lambert,),
    "lommel-seeliger": (lommel_seeliger,),
    "lunar-lambert": (lunar_lambert,),
    "mixture": (lambert, lommel_seeliger, _mu0_mu, _mu0_squared),
}
