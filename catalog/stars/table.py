"""A table of catalog stars, and where they are seen from a moving spacecraft at a time."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

J2000_YEAR = 2000.0
SECONDS_OF_YEAR = 365.25 * 86400.0
LIGHT_KM_PER_S = 299792.458
AU_KM = 149597870.7
MAS = np.pi / 180.0 / 3.6e6


@dataclass(frozen=True)
class StarTable:
    """Stars of a catalog at its epoch.

    name: of the catalog. ident: (n,) text. ra_deg, dec_deg: (n,) ICRS. magnitude: (n,), NaN where unknown. pm_ra_mas,
    pm_dec_mas: (n,) proper motion in milliarcseconds a Julian year, in right ascension times cos(dec). parallax_mas:
    (n,), 0 where unknown. epoch: Julian year (TDB) of the directions.
    """

    name: str
    ident: NDArray[np.str_]
    ra_deg: Array
    dec_deg: Array
    magnitude: Array
    pm_ra_mas: Array
    pm_dec_mas: Array
    parallax_mas: Array
    epoch: float

    def __len__(self) -> int:
        return len(self.ra_deg)

    def only(self, chosen: NDArray) -> "StarTable":
        """The stars that an index or a mask chooses."""
        fields = ("ident", "ra_deg", "dec_deg", "magnitude", "pm_ra_mas", "pm_dec_mas", "parallax_mas")
        return replace(self, **{name: getattr(self, name)[chosen] for name in fields})

    def by_brightness(self) -> "StarTable":
        """The same, brightest first; unknown magnitudes last."""
        return self.only(np.argsort(self.magnitude, kind="stable"))

    def within(self, axis: ArrayLike, radius_deg: float) -> "StarTable":
        """Stars no farther than `radius_deg` from a direction (3,)."""
        return self.only(unit_vectors(self.ra_deg, self.dec_deg) @ np.asarray(axis) >= np.cos(np.radians(radius_deg)))

    def directions(self, year: float, from_sun_km: ArrayLike | None = None) -> Array:
        """Unit vectors (n, 3), ICRS, at a Julian year: straight motion in space without the radial part, whose effect
        on the direction is of second order. from_sun_km: (3,) observer from the solar system's barycentre, for the
        parallax."""
        u = unit_vectors(self.ra_deg, self.dec_deg)
        ra = np.radians(self.ra_deg)
        east = np.stack([-np.sin(ra), np.cos(ra), np.zeros_like(ra)], axis=-1)
        north = np.cross(u, east)
        years = year - self.epoch
        moved = u + (years * MAS) * (self.pm_ra_mas[:, None] * east + self.pm_dec_mas[:, None] * north)
        if from_sun_km is not None:
            moved = moved - (self.parallax_mas * MAS)[:, None] * (np.asarray(from_sun_km) / AU_KM)
        return moved / np.linalg.norm(moved, axis=-1, keepdims=True)


def unit_vectors(ra_deg: ArrayLike, dec_deg: ArrayLike) -> Array:
    """Unit vectors (..., 3) of right ascension and declination in degrees."""
    ra, dec = np.radians(np.asarray(ra_deg, float)), np.radians(np.asarray(dec_deg, float))
    return np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=-1)


def ra_dec_deg(direction: ArrayLike) -> Array:
    """Right ascension (0-360) and declination (..., 2), degrees, of vectors (..., 3)."""
    v = np.asarray(direction, dtype=np.float64)
    ra = np.degrees(np.arctan2(v[..., 1], v[..., 0])) % 360.0
    return np.stack([ra, np.degrees(np.arctan2(v[..., 2], np.hypot(v[..., 0], v[..., 1])))], axis=-1)


def julian_year(et: float) -> float:
    """Julian year (TDB) of TDB seconds past J2000."""
    return J2000_YEAR + et / SECONDS_OF_YEAR


def aberrated(direction: ArrayLike, velocity_km_s: ArrayLike) -> Array:
    """Apparent unit vectors (n, 3) of unit vectors (n, 3) for an observer of this velocity (3,) relative to the solar
    system's barycentre: special relativity (Explanatory Supplement, 7.40; as erfa's `ab` without the Sun's part)."""
    u, beta = np.asarray(direction, dtype=np.float64), np.asarray(velocity_km_s, dtype=np.float64) / LIGHT_KM_PER_S
    along = u @ beta
    root = np.sqrt(1.0 - beta @ beta)
    seen = (root * u + (1.0 + along / (1.0 + root))[..., None] * beta) / (1.0 + along)[..., None]
    return np.asarray(seen / np.linalg.norm(seen, axis=-1, keepdims=True))
