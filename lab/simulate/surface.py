"""The surface that simulated images show: another photometric law and another map than the corrections assume."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import BaseMap
from lab.simulate.randomness import SmoothField
from tasks.geometry.bilinear import map_values
from tasks.photometry.hapke import HapkeSurface, hapke
from tasks.simulate.photometry import lambert, lommel_seeliger, lunar_lambert

Array = NDArray[np.float64]
LawName = Literal["hapke", "minnaert", "lommel-seeliger", "mixture", "lunar-lambert"]
MISMATCHED: tuple[LawName, ...] = ("hapke", "minnaert", "lommel-seeliger")
GRAZING = 0.05  # Minnaert's law has no limit at the limb of a surface seen edge-on


@dataclass(frozen=True)
class TrueSurface:
    """law: photometric law; parameters: its figures; region: how they vary (a field of standard deviation 1), None for
    a uniform surface. basemap: relative albedo; map_error: relative, times a second field."""

    law: LawName
    parameters: dict[str, float]
    basemap: BaseMap
    region: SmoothField | None = None
    map_error: float = 0.0
    map_field: SmoothField | None = None

    def brightness(self, unit: Array, mu0: Array, mu: Array, cos_phase: Array) -> Array:
        """Relative brightness (n,) of places seen in directions `unit` (n, 3) from the centre, body-fixed."""
        latitude = np.degrees(np.arcsin(np.clip(unit[:, 2], -1, 1)))
        longitude = np.degrees(np.arctan2(unit[:, 1], unit[:, 0]))
        albedo = map_values(self.basemap.albedo, self.basemap.left_edge_deg, latitude, longitude)
        if self.map_field is not None:
            albedo = albedo * np.maximum(1 + self.map_error * self.map_field(unit), 0.1)
        region = np.zeros_like(mu0) if self.region is None else self.region(unit)
        lit = (mu0 > 0) & (mu > 0)
        value = np.zeros_like(mu0)
        value[lit] = albedo[lit] * self._reflectance(mu0[lit], mu[lit], cos_phase[lit], region[lit])
        return value

    def _reflectance(self, mu0: Array, mu: Array, cos_phase: Array, region: Array) -> Array:
        given = self.parameters
        phase_deg = np.degrees(np.arccos(np.clip(cos_phase, -1, 1)))
        if self.law == "hapke":
            names = ("w", "b", "c", "b0", "h", "theta_deg")
            w = np.clip(given["w"] + given["w_spread"] * region, 0.5, 0.995)
            return hapke(mu0, mu, cos_phase, HapkeSurface(**{name: given[name] for name in names}), w)
        if self.law == "minnaert":
            k = np.clip(given["k"] + given["k_per_deg"] * phase_deg + given["k_spread"] * region, 0.4, 1.0)
            return np.asarray(mu0**k * np.maximum(mu, GRAZING) ** (k - 1))
        if self.law == "lommel-seeliger":
            dimming = given["mag_per_deg"] * (1 + given["mag_spread"] * region) * phase_deg
            return np.asarray(mu0 / (mu0 + mu) * 10 ** (-0.4 * dimming))
        phase = float(phase_deg.mean()) if phase_deg.size else 0.0
        mu0_32, mu_32 = mu0.astype(np.float32), mu.astype(np.float32)
        if self.law == "lunar-lambert":
            return lunar_lambert(mu0_32, mu_32, phase).astype(np.float64)
        laws = {"lambert": lambert, "lommel-seeliger": lommel_seeliger}
        both = sum(given[name] * law(mu0_32, mu_32, phase).astype(np.float64) for name, law in laws.items())
        return np.asarray(both)

    def facts(self) -> dict[str, Any]:
        """Plain values for the record of what was planted."""
        return {
            "law": self.law,
            "parameters": self.parameters,
            "regional_variation": self.region is not None,
            "map": self.basemap.name,
            "map_sha256": self.basemap.sha256,
            "map_left_edge_deg": self.basemap.left_edge_deg,
            "map_error": self.map_error,
        }


def mismatched_surface(rng: np.random.Generator, basemap: BaseMap) -> TrueSurface:
    """One of `MISMATCHED` with Europa-like figures that vary with the place, and a map that is a few per cent wrong.

    Hapke: see `HapkeSurface`, with w +- 0.02 and slopes of 5 to 20 deg (the regions of Belgacem et al. 2020, Icarus
    338, 113525, differ by more). Minnaert: k grows with phase (McEwen 1991, Icarus 92, 298). Lommel-Seeliger: dims by
    0.01 to 0.02 mag per degree, by places +- 15 %.
    """
    law = MISMATCHED[rng.integers(len(MISMATCHED))]
    figures: dict[str, dict[str, float]] = {
        "hapke": {
            "w": float(rng.uniform(0.92, 0.975)),
            "w_spread": 0.02,
            "b": -0.429,
            "c": float(rng.uniform(0.08, 0.3)),
            "b0": 0.5,
            "h": 0.0016,
            "theta_deg": float(rng.uniform(5, 20)),
        },
        "minnaert": {"k": float(rng.uniform(0.52, 0.62)), "k_per_deg": 0.002, "k_spread": 0.03},
        "lommel-seeliger": {"mag_per_deg": float(rng.uniform(0.01, 0.02)), "mag_spread": 0.15},
    }
    map_error = float(rng.uniform(0.02, 0.05))
    region, map_field = SmoothField(rng, 1.0, 4.0), SmoothField(rng, 2.0, 12.0)
    return TrueSurface(law, figures[law], basemap, region, map_error, map_field)


def matched_surface(rng: np.random.Generator, basemap: BaseMap) -> TrueSurface:
    """A mixture of Lambert and Lommel-Seeliger, which the corrections' mixture of laws contains, and an exact map."""
    weight = float(rng.uniform(0.2, 0.6))
    return TrueSurface("mixture", {"lambert": weight, "lommel-seeliger": 1 - weight}, basemap)
