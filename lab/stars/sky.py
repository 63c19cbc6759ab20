"""A sky of made-up stars, and where a moving observer sees them: by erfa (IAU SOFA), which the identification does not
use."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.stars.source import Cone
from catalog.stars.table import StarTable

Array = NDArray[np.float64]
EPOCH = 2016.0
SLOPE = 0.42  # of the logarithm of star counts per magnitude, around G = 10
SPEED_OF_LIGHT_KM_S = 299792.458


@dataclass(frozen=True)
class MadeUpSky:
    """A star catalog (`catalog.stars.source.StarCatalog`) of made-up stars around a direction."""

    table: StarTable
    name: str = "made-up stars"

    def stars(self, cone: Cone | None = None) -> StarTable:
        """Stars within a cone, or all; brightest first."""
        return self.table if cone is None else self.table.within(cone.axis, cone.radius_deg)


def made_up_sky(axis: Array, radius_deg: float, per_square_degree: float, random: np.random.Generator) -> MadeUpSky:
    """Stars evenly spread over a circle of the sky, of magnitudes 4 to 12 as they are frequent, with proper motions."""
    area = 2 * np.pi * (1 - np.cos(np.radians(radius_deg))) * (180 / np.pi) ** 2
    count = max(20, int(random.poisson(area * per_square_degree)))
    height = 1 - random.uniform(0, 1 - np.cos(np.radians(radius_deg)), count)
    around = random.uniform(0, 2 * np.pi, count)
    side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    out = np.sqrt(1 - height**2)[:, None]
    v = height[:, None] * axis + out * (np.cos(around)[:, None] * side + np.sin(around)[:, None] * np.cross(axis, side))
    low, high = 10 ** (SLOPE * 4.0), 10 ** (SLOPE * 12.0)
    magnitude = np.log10(random.uniform(low, high, count)) / SLOPE
    motion = random.normal(0, 40.0, (2, count))
    table = StarTable(
        "made-up stars", np.array([f"star {number}" for number in range(count)]),
        np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360, np.degrees(np.arcsin(np.clip(v[:, 2], -1, 1))), magnitude,
        motion[0], motion[1], np.zeros(count), EPOCH,
    )  # fmt: skip
    return MadeUpSky(table.by_brightness())


def seen_directions(table: StarTable, year: float, velocity_km_s: Array) -> Array:
    """Unit vectors (n, 3), J2000, in which an observer of this velocity (3,) sees the stars at a Julian year."""
    import erfa

    mas = np.radians(1.0 / 3.6e6)
    ra, dec = np.radians(table.ra_deg), np.radians(table.dec_deg)
    moved = erfa.pmsafe(
        ra, dec, table.pm_ra_mas * mas / np.cos(dec), table.pm_dec_mas * mas, 1e-3, 0.0,
        2451545.0, (table.epoch - 2000.0) * 365.25, 2451545.0, (year - 2000.0) * 365.25,
    )  # fmt: skip
    proper = erfa.s2c(moved[0], moved[1])
    beta = velocity_km_s / SPEED_OF_LIGHT_KM_S
    far_from_the_sun_au = 1e6  # no deflection of light
    return np.asarray(erfa.ab(proper, beta, far_from_the_sun_au, float(np.sqrt(1 - beta @ beta))))
