"""Rotations and positions as ISIS' tables and ISDs carry them, at one time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.rotation import checked_rotation, nearest_rotation

Array = NDArray[np.float64]
NEAREST_S = 1.0  # a table of one entry holds for a frame camera's exposure; ISIS writes its middle
UNIT_LENGTH = 1e-3
LIGHT_KM_PER_S = 299792.458
PRINTED_DIGITS = 1e-6  # labels hold rotations with 6 to 15 digits


@dataclass(frozen=True)
class Rotations:
    """Quaternions (n, 4), scalar first as SPICE's M2Q, from J2000 to a moving frame at times (n,) in TDB seconds past
    J2000, and the constant rotation (3, 3) from there to the wanted frame. angular_velocities_rad_s: (n, 3) of the
    frame, in J2000, where known."""

    times: Array
    quaternions: Array
    constant: Array
    angular_velocities_rad_s: Array | None = None

    def at(self, et: float) -> Array:
        """Rotation (3, 3) from J2000 to the wanted frame at `et`, interpolated on the sphere between entries.

        Raises ValueError for a time outside the table, and for what is no rotation.
        """
        from scipy.spatial.transform import Rotation, Slerp

        _check_covered(self.times, et)
        lengths = np.linalg.norm(self.quaternions, axis=-1)
        if not np.abs(lengths - 1).max() < UNIT_LENGTH:
            raise ValueError(f"its quaternions have lengths {lengths.min():.4g} to {lengths.max():.4g}, not 1")
        # SPICE's M2Q(R) and scipy's quaternion of R are the same but for the place of the scalar
        rotations = Rotation.from_quat(self.quaternions[:, [1, 2, 3, 0]])
        inside = float(np.clip(et, self.times[0], self.times[-1]))
        moving = rotations[0] if len(self.times) == 1 else Slerp(self.times, rotations)(inside)
        return checked_rotation(nearest_rotation(self.constant @ moving.as_matrix()), "rotation")

    def when_light_left(self, et: float, distance_km: float) -> Array:
        """Rotation (3, 3) of a body `distance_km` away when its light left, by the angular velocity: ISIS' and ALE's
        tables have bodies as they are turned at `et`. Without angular velocities that one is given."""
        from scipy.spatial.transform import Rotation

        turned = self.at(et)
        if self.angular_velocities_rad_s is None:
            return turned
        rate = self.angular_velocities_rad_s[int(np.abs(self.times - et).argmin())]
        return checked_rotation(
            nearest_rotation(turned @ Rotation.from_rotvec(rate * distance_km / LIGHT_KM_PER_S).as_matrix()), "rotation"
        )


@dataclass(frozen=True)
class Positions:
    """Positions (n, 3) in km, J2000, and velocities (n, 3) in km/s where known, at times (n,)."""

    times: Array
    positions_km: Array
    velocities_km_s: Array | None = None

    def at(self, et: float) -> Array:
        """Position (3,) at `et`: cubic between entries with velocities, linear without.

        Raises ValueError for a time outside the table.
        """
        from scipy.interpolate import CubicHermiteSpline

        _check_covered(self.times, et)
        if len(self.times) == 1:
            moved = 0.0 if self.velocities_km_s is None else self.velocities_km_s[0] * (et - self.times[0])
            return np.asarray(self.positions_km[0] + moved)
        inside = float(np.clip(et, self.times[0], self.times[-1]))
        if self.velocities_km_s is None:
            return np.array([np.interp(inside, self.times, column) for column in self.positions_km.T])
        return np.asarray(CubicHermiteSpline(self.times, self.positions_km, self.velocities_km_s)(inside))


def _check_covered(times: Array, et: float) -> None:
    if not (times.size and np.isfinite(times).all() and (np.diff(times) > 0).all()):
        raise ValueError("its times are missing, not finite or do not increase")
    if not times[0] - NEAREST_S <= et <= times[-1] + NEAREST_S:
        raise ValueError(f"it covers et {times[0]:.3f} to {times[-1]:.3f}, the exposure is at {et:.3f}")


def matrix(values: Sequence[float] | None) -> Array:
    """A rotation (3, 3) of nine numbers, row by row; the identity for None. Raises ValueError for another count."""
    if values is None:
        return np.eye(3)
    if len(values) != 9:
        raise ValueError(f"a constant rotation has nine numbers, not {len(values)}")
    rows = np.array(values, dtype=np.float64).reshape(3, 3)
    if not np.abs(rows @ rows.T - np.eye(3)).max() < PRINTED_DIGITS:
        raise ValueError("its constant rotation is no rotation")
    return nearest_rotation(rows)
