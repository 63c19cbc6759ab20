"""Phase functions with free parameters: reflectance of a surface from incidence, emission and phase."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.photometry.hapke import HapkeSurface, hapke

Array = NDArray[np.float64]
Values = Mapping[str, float]
NARROW_PHASES_DEG = 5.0  # images that span less of phase say nothing of how brightness changes with it
OPPOSITION_SURGE_DEG = 5.0  # Europa's surge is narrower by far


@dataclass(frozen=True)
class Parameter:
    """One number of a law: where a fit starts, its limits, its unit (empty: none) and its meaning. needs_phases: cannot
    be determined from images of one phase; needs_opposition: nor without small phases. Held at `held` then."""

    name: str
    start: float
    low: float
    high: float
    meaning: str
    unit: str = ""
    needs_phases: bool = False
    needs_opposition: bool = False
    held: float = 0.0


@dataclass(frozen=True)
class PhotometricLaw:
    """reflectance(values, mu0, mu, phase_deg) of lit and seen places (n,). scaled: its unit is the image's own, so that
    images need no calibration; otherwise it is I/F."""

    name: str
    parameters: tuple[Parameter, ...]
    reflectance: Callable[[Values, Array, Array, Array], Array]
    scaled: bool

    def held_without(self, phases_deg: Array) -> dict[str, float]:
        """Parameters that images of these phases cannot tell, and the values they are held at."""
        narrow = float(np.ptp(phases_deg)) < NARROW_PHASES_DEG
        far_from_opposition = float(np.min(phases_deg)) > OPPOSITION_SURGE_DEG
        return {
            p.name: p.held
            for p in self.parameters
            if (p.needs_phases and narrow) or (p.needs_opposition and far_from_opposition)
        }


def lunar_lambert_reflectance(values: Values, mu0: Array, mu: Array, phase_deg: Array) -> Array:
    """albedo 10^(-0.4 mag_per_deg phase) (L 2 mu0 / (mu0 + mu) + (1 - L) mu0), L = limb_weight + limb_weight_per_deg
    phase (McEwen 1991, Icarus 92, 298, with a straight line for its L)."""
    weight = values["limb_weight"] + values["limb_weight_per_deg"] * phase_deg
    shape = weight * 2 * mu0 / np.maximum(mu0 + mu, 1e-6) + (1 - weight) * mu0
    return np.asarray(values["albedo"] * 10 ** (-0.4 * values["mag_per_deg"] * phase_deg) * shape)


def hapke_reflectance(values: Values, mu0: Array, mu: Array, phase_deg: Array) -> Array:
    """I/F by Hapke's model with roughness; see `tasks.photometry.hapke`."""
    surface = HapkeSurface(**{name: float(values[name]) for name in ("w", "b", "c", "b0", "h", "theta_deg")})
    return hapke(mu0, mu, np.cos(np.radians(phase_deg)), surface)


LUNAR_LAMBERT = PhotometricLaw(
    "lunar-lambert",
    (
        Parameter("albedo", 1.0, 1e-9, np.inf, "normal albedo at phase 0, in the image's unit"),
        Parameter("mag_per_deg", 0.01, -0.05, 0.1, "how fast it dims with phase", "mag/deg", needs_phases=True),
        Parameter("limb_weight", 0.6, -1.0, 2.0, "L, the share of Lommel-Seeliger, at phase 0"),
        Parameter("limb_weight_per_deg", -0.004, -0.05, 0.05, "its change with phase", "1/deg", needs_phases=True),
    ),
    lunar_lambert_reflectance,
    scaled=True,
)
HAPKE = PhotometricLaw(
    "hapke",
    (
        Parameter("w", 0.9, 0.05, 0.9999, "single-scattering albedo"),
        Parameter("b", -0.3, -0.95, 0.95, "asymmetry of the particle phase function", needs_phases=True, held=-0.429),
        Parameter("c", 0.2, 0.0, 1.0, "share of its forward lobe", needs_phases=True, held=0.113),
        Parameter("theta_deg", 15.0, 0.1, 50.0, "mean slope", "deg"),
        Parameter("b0", 0.5, 0.0, 2.0, "opposition effect, height", needs_opposition=True, held=0.5),
        Parameter("h", 0.002, 1e-4, 0.2, "opposition effect, width", needs_opposition=True, held=0.0016),
    ),
    hapke_reflectance,
    scaled=False,
)  # held: Europa (Domingue et al. 1991, Icarus 90, 30)
LAWS = {law.name: law for law in (LUNAR_LAMBERT, HAPKE)}


def find_law(name: str) -> PhotometricLaw:
    """The law of this name. Raises RefusedError when there is none."""
    if name not in LAWS:
        raise RefusedError(Reason.LAW_UNKNOWN, f"there is no phase function {name}.", f"Known are {', '.join(LAWS)}.")
    return LAWS[name]
