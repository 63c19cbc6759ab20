"""Photometric laws with free parameters: reflectance of a surface from incidence, emission and phase, and what it would
be under a standard illumination."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from tasks.photometry.hapke import HapkeSurface, hapke

Array = NDArray[np.float64]
Values = Mapping[str, float]
NARROW_PHASES_DEG = 5.0  # images that span less of phase say nothing of how brightness changes with it
OPPOSITION_SURGE_DEG = 5.0  # Europa's surge is narrower by far
# Incidence, emission and phase of RELAB and of the photometric catalogs of ISIS and LROC.
STANDARD_GEOMETRY_DEG = (30.0, 0.0, 30.0)
LEAST_COSINE = 1e-6
IMAGE_UNITS, RADIANCE_FACTOR = "image units", "I/F"


@dataclass(frozen=True)
class Parameter:
    """One number of a law: where a fit starts, its limits, its unit (empty: none) and its meaning. needs_phases: cannot
    be determined from images of one phase; needs_opposition: nor without small phases; only_with_prior: nor from
    brightness at all, as another parameter does the same. Held at `held` then."""

    name: str
    start: float
    low: float
    high: float
    meaning: str
    unit: str = ""
    needs_phases: bool = False
    needs_opposition: bool = False
    only_with_prior: bool = False
    held: float = 0.0


@dataclass(frozen=True)
class PhotometricLaw:
    """reflectance(values, mu0, mu, phase_deg) of lit and seen places (n,). scaled: its albedo has the image's own unit
    unless the images' scale is given; otherwise it is I/F."""

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

    @property
    def usual_values(self) -> dict[str, float]:
        """Values where a fit starts."""
        return {p.name: p.start for p in self.parameters}

    def normalising_factor(
        self,
        values: Values,
        incidence_deg: ArrayLike,
        emission_deg: ArrayLike,
        phase_deg: ArrayLike,
        standard_deg: tuple[float, float, float] = STANDARD_GEOMETRY_DEG,
    ) -> Array:
        """What a brightness seen at these angles (n,), degrees, is multiplied with to have what the same ground shows
        at `standard_deg` (incidence, emission, phase); NaN where it is not lit or not seen."""
        angles = np.broadcast_arrays(*(np.asarray(a, np.float64) for a in (incidence_deg, emission_deg, phase_deg)))
        mu0, mu = (np.cos(np.radians(angle)) for angle in angles[:2])
        i, e, g = (np.array([angle]) for angle in standard_deg)
        wanted = self.reflectance(values, np.cos(np.radians(i)), np.cos(np.radians(e)), g)
        shown = (mu0 > 0) & (mu > 0)
        factor = np.full(mu0.shape, np.nan)
        seen = self.reflectance(values, mu0[shown], mu[shown], angles[2][shown])
        factor[shown] = wanted / np.where(seen > 0, seen, np.nan)
        return factor


def dimming(values: Values, phase_deg: Array) -> Array:
    """albedo 10^(-0.4 mag_per_deg phase), what all laws with an albedo have in common."""
    return np.asarray(values["albedo"] * 10 ** (-0.4 * values["mag_per_deg"] * phase_deg))


def lambert_reflectance(values: Values, mu0: Array, mu: Array, phase_deg: Array) -> Array:  # noqa: ARG001
    """mu0 (Lambert 1760)."""
    return dimming(values, phase_deg) * mu0


def lommel_seeliger_reflectance(values: Values, mu0: Array, mu: Array, phase_deg: Array) -> Array:
    """2 mu0 / (mu0 + mu) (Seeliger 1887)."""
    return np.asarray(dimming(values, phase_deg) * 2 * mu0 / np.maximum(mu0 + mu, LEAST_COSINE))


def lunar_lambert_reflectance(values: Values, mu0: Array, mu: Array, phase_deg: Array) -> Array:
    """L 2 mu0 / (mu0 + mu) + (1 - L) mu0, L = limb_weight + limb_weight_per_deg phase (McEwen 1991, Icarus 92, 298,
    with a straight line for its L)."""
    weight = values["limb_weight"] + values["limb_weight_per_deg"] * phase_deg
    shape = weight * 2 * mu0 / np.maximum(mu0 + mu, LEAST_COSINE) + (1 - weight) * mu0
    return np.asarray(dimming(values, phase_deg) * shape)


def mcewen_reflectance(values: Values, mu0: Array, mu: Array, phase_deg: Array) -> Array:
    """The same with McEwen's L of the Moon, 1 - 0.019 g + 2.42e-4 g^2 - 1.46e-6 g^3 (McEwen 1996, LPSC 27, 841)."""
    weight = np.clip(1 - 0.019 * phase_deg + 2.42e-4 * phase_deg**2 - 1.46e-6 * phase_deg**3, 0, 1)
    shape = weight * 2 * mu0 / np.maximum(mu0 + mu, LEAST_COSINE) + (1 - weight) * mu0
    return np.asarray(dimming(values, phase_deg) * shape)


def minnaert_reflectance(values: Values, mu0: Array, mu: Array, phase_deg: Array) -> Array:
    """mu0^k mu^(k - 1), k = k + k_per_deg phase (Minnaert 1941, Astrophys. J. 93, 403)."""
    k = values["k"] + values["k_per_deg"] * phase_deg
    return np.asarray(dimming(values, phase_deg) * mu0**k * np.maximum(mu, LEAST_COSINE) ** (k - 1))


def akimov_reflectance(values: Values, mu0: Array, mu: Array, phase_deg: Array) -> Array:
    """cos(g/2) cos(pi / (pi - g) (l - g/2)) cos(b)^(nu g / (pi - g)) / cos(l), with photometric longitude l and
    latitude b (Akimov 1988; Shkuratov et al. 2011, Planet. Space Sci. 59, 1326, equations 17 to 19; nu 1: bright,
    0.52: lunar maria)."""
    g = np.clip(np.radians(phase_deg), 1e-9, np.pi - 1e-6)
    longitude = np.arctan2(mu0 / np.maximum(mu, LEAST_COSINE) - np.cos(g), np.sin(g))
    cos_longitude = np.maximum(np.cos(longitude), LEAST_COSINE)
    cos_latitude = np.clip(mu / cos_longitude, LEAST_COSINE, 1.0)
    turned = np.cos(np.pi / (np.pi - g) * (longitude - g / 2))
    disk = np.cos(g / 2) * turned * cos_latitude ** (values["nu"] * g / (np.pi - g)) / cos_longitude
    return np.asarray(dimming(values, phase_deg) * np.maximum(disk, 0.0))


def _hapke_by(exact_h: bool, anisotropic: bool) -> Callable[[Values, Array, Array, Array], Array]:
    def reflectance(values: Values, mu0: Array, mu: Array, phase_deg: Array) -> Array:
        """I/F by Hapke's model with roughness; see `tasks.photometry.hapke`."""
        given = {name: float(value) for name, value in values.items() if name in HapkeSurface.__dataclass_fields__}
        surface = HapkeSurface(**given)
        cos_phase = np.cos(np.radians(phase_deg))
        return hapke(mu0, mu, cos_phase, surface, exact_h=exact_h, anisotropic=anisotropic)

    return reflectance


_DIMMING = (
    Parameter("albedo", 1.0, 1e-9, np.inf, "normal albedo at phase 0"),
    Parameter("mag_per_deg", 0.01, -0.05, 0.1, "how fast it dims with phase", "mag/deg", needs_phases=True),
)
_LIMB_WEIGHT = (
    Parameter("limb_weight", 0.6, -1.0, 2.0, "L, the share of Lommel-Seeliger, at phase 0"),
    Parameter("limb_weight_per_deg", -0.004, -0.05, 0.05, "its change with phase", "1/deg", needs_phases=True),
)
_MINNAERT = (
    Parameter("k", 0.6, 0.1, 1.5, "Minnaert's exponent at phase 0"),
    Parameter("k_per_deg", 0.002, -0.02, 0.02, "its change with phase", "1/deg", needs_phases=True),
)
_AKIMOV = (Parameter("nu", 1.0, 0.0, 2.0, "darkening towards the poles", needs_phases=True, held=1.0),)
_HAPKE = (
    Parameter("w", 0.9, 0.05, 0.9999, "single-scattering albedo"),
    Parameter("b", -0.3, -0.95, 0.95, "asymmetry of the particle phase function", needs_phases=True, held=-0.429),
    Parameter("c", 0.2, 0.0, 1.0, "share of its forward lobe", needs_phases=True, held=0.113),
    Parameter("theta_deg", 15.0, 0.1, 50.0, "mean slope", "deg"),
    Parameter("b0", 0.5, 0.0, 2.0, "opposition effect, height", needs_opposition=True, held=0.5),
    Parameter("h", 0.002, 1e-4, 0.2, "opposition effect, width", needs_opposition=True, held=0.0016),
)  # held: Europa (Domingue et al. 1991, Icarus 90, 30)
_COHERENT = (
    Parameter("bc0", 0.2, 0.0, 1.0, "coherent backscatter, height", needs_opposition=True, held=0.0),
    Parameter("hc", 0.01, 1e-4, 0.5, "coherent backscatter, width", needs_opposition=True, held=0.05),
)
_FILLING = (Parameter("filling", 0.1, 1e-4, 0.74, "share of the volume that particles fill", only_with_prior=True),)
LAWS = {
    law.name: law
    for law in (
        PhotometricLaw("lambert", _DIMMING, lambert_reflectance, scaled=True),
        PhotometricLaw("lommel-seeliger", _DIMMING, lommel_seeliger_reflectance, scaled=True),
        PhotometricLaw("lunar-lambert", (*_DIMMING, *_LIMB_WEIGHT), lunar_lambert_reflectance, scaled=True),
        PhotometricLaw("mcewen", _DIMMING, mcewen_reflectance, scaled=True),
        PhotometricLaw("minnaert", (*_DIMMING, *_MINNAERT), minnaert_reflectance, scaled=True),
        PhotometricLaw("akimov", (*_DIMMING, *_AKIMOV), akimov_reflectance, scaled=True),
        PhotometricLaw("hapke", _HAPKE, _hapke_by(False, False), scaled=False),
        PhotometricLaw("hapke-2002", (*_HAPKE, *_COHERENT), _hapke_by(True, True), scaled=False),
        PhotometricLaw("hapke-2012", (*_HAPKE, *_COHERENT, *_FILLING), _hapke_by(True, False), scaled=False),
    )
}  # fmt: skip
LUNAR_LAMBERT, HAPKE = LAWS["lunar-lambert"], LAWS["hapke"]


def find_law(name: str) -> PhotometricLaw:
    """The law of this name. Raises RefusedError when there is none."""
    if name not in LAWS:
        raise RefusedError(Reason.LAW_UNKNOWN, f"there is no phase function {name}.", f"Known are {', '.join(LAWS)}.")
    return LAWS[name]
