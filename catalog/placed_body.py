"""Another body of an image: what it is, and where it is relative to the target."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, ValidationError, field_validator

from catalog.body import Ring, RotationModel, Target
from catalog.rotation import checked_rotation

Vector3 = tuple[float, float, float]
Matrix3 = tuple[Vector3, Vector3, Vector3]
LIGHT_KM_PER_S = 299792.458
# 1-sigma of a satellite's place relative to another one: ephemerides of the planets' larger satellites agree with
# images to 5-20 km (Jacobson et al. 2006, AJ 132, 2520; Cooper et al. 2018, A&A 610, A2).
EPHEMERIS_KM = 10.0


class PlacedBody(BaseModel):
    """A body beside the target.

    from_target_km: its centre as the spacecraft sees it less the target's (J2000; both LT+S), which no error of the
    camera or the trajectory changes. body_from_j2000: when the light that is seen left it. sun_from_body_km: J2000, as
    `Pose.sun_from_target_km`. velocity_km_s: as `Pose.target_velocity_km_s`. seen_from_km: its centre as bodies of
    these NAIF ids see it (their LT+S), from which its shadow on them follows; where it lacks, the difference of what
    the spacecraft sees. sigma_km: 1-sigma of its place relative to the target. relief_km: RMS of its surface about the
    ellipsoid. turn_deg_per_day: rotation.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str = Field(min_length=1, max_length=80)
    naif_id: int
    radii_km: tuple[PositiveFloat, PositiveFloat, PositiveFloat]
    from_target_km: Vector3
    sun_from_body_km: Vector3
    body_from_j2000: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    velocity_km_s: Vector3 | None = None
    seen_from_km: dict[int, Vector3] = Field(default_factory=dict)
    sigma_km: float = Field(EPHEMERIS_KM, ge=0)
    relief_km: float = Field(0.0, ge=0)
    geometric_albedo: PositiveFloat = 0.5
    turn_deg_per_day: float = 0.0
    rings: tuple[Ring, ...] = ()

    @field_validator("body_from_j2000", mode="before")
    @classmethod
    def _is_a_rotation(cls, value: Any) -> Any:
        return checked_rotation(value, "body_from_j2000").tolist()

    @field_validator("from_target_km", "sun_from_body_km")
    @classmethod
    def _is_a_position(cls, value: Vector3) -> Vector3:
        if not np.isfinite(value).all() or not any(value):
            raise ValueError(f"three finite kilometres are needed, not all zero; got {value}")
        return value

    @property
    def offset_km(self) -> NDArray[np.float64]:
        """from_target_km as an array (3,)."""
        return np.array(self.from_target_km)

    @property
    def rotation(self) -> NDArray[np.float64]:
        """body_from_j2000 as an array (3, 3)."""
        return np.array(self.body_from_j2000)

    @property
    def as_target(self) -> Target:
        """The body as something to project on. Its rotation model knows nothing but the rate."""
        rate = RotationModel(pole_ra_deg=(0.0,), pole_dec_deg=(90.0,), prime_meridian_deg=(0.0, self.turn_deg_per_day))
        return Target(name=self.name, naif_id=self.naif_id, radii_km=self.radii_km, rotation=rate, rings=self.rings)

    @classmethod
    def of(cls, target: Target, **placed: Any) -> "PlacedBody":
        """A body of the catalog at a place."""
        rates = target.rotation.prime_meridian_deg if target.rotation else ()
        return cls(
            name=target.name,
            naif_id=target.naif_id,
            radii_km=target.radii_km,
            relief_km=target.expected_relief_km,
            geometric_albedo=target.geometric_albedo,
            turn_deg_per_day=rates[1] if len(rates) > 1 else 0.0,
            rings=target.rings,
            **placed,
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values that `body_from_dict` reads back."""
        return self.model_dump(mode="json", exclude_defaults=True)


def body_from_dict(content: Any, number: int) -> PlacedBody:
    """One entry of a pose file's `bodies`. Raises ValueError naming the entry and each bad field."""
    where = f"bodies[{number}]"
    if not isinstance(content, Mapping):
        raise ValueError(f"{where} is no JSON object")
    try:
        return PlacedBody.model_validate(dict(content))
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, e['loc'])) or 'body'}: {e['msg']}" for e in error.errors())
        raise ValueError(f"{where} ({content.get('name', 'without a name')}): {faults}") from error
