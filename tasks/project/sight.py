"""How the spacecraft sees the body: one linear map from pinhole vectors to lines of sight in the body-fixed frame.

A pose that knows no velocities is one fixed geometry: the map is a rotation. One that does is seen with stellar
aberration, which differs over the disk, and by light that left each point at its own time. Both are linear in the
velocities over speed of light, and stay a linear map of the line of sight:

For an apparent direction u (unit vector) the true one is u' = (u - v/c) / |u - v/c|, v the spacecraft's velocity
(SPICE's STELAB inverted). The point at light distance s was where the body's centre was when the light left:
s u' = D' + V (s0 - s)/c + p, V the body's velocity, D' the true position of the centre, s0 its distance. So
s (u' + V/c) = (D' + V s0/c) + p: straight lines from one place, their directions u - v/c + |u - v/c| V/c.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.body import SECONDS_PER_DAY, Target
from catalog.pose import Pose

Array = NDArray[np.float64]
LIGHT_KM_PER_S = 299792.458


@dataclass(frozen=True)
class Sight:
    """Body-fixed geometry of a pose's lines of sight; directions are given as (x, y, 1), x and y over focal length.

    spacecraft_km: (3,), where the lines start. body_from_camera: (3, 3), directions of the lines, whose points the
    pixels see. apparent_from_camera: (3, 3) rotation, directions as the camera sees them, from which SPICE (ILUMIN)
    counts emission and phase. range_scale: light distance by length along the line. turn_deg_per_km: how much further
    east a point lies for each km that it is further away than the centre, since the body turned while light passed it.
    """

    spacecraft_km: Array
    body_from_camera: Array
    apparent_from_camera: Array
    range_scale: float = 1.0
    range_km: float = 0.0
    turn_deg_per_km: float = 0.0

    @property
    def target_in_camera_km(self) -> Array:
        """The target's centre in the pinhole's frame (3,): its pixel is that whose line goes through the centre."""
        return np.asarray(np.linalg.solve(self.body_from_camera, -self.spacecraft_km), dtype=np.float64)


def sight_of(pose: Pose, target: Target | None = None) -> Sight:
    """How `pose` sees its target. Without `target`, light time over the disk leaves out its turning, and a term of
    (radius / range)^2 v/c."""
    rotation = pose.camera_from_body.T
    if pose.spacecraft_velocity_km_s is None or pose.target_velocity_km_s is None:
        return Sight(pose.spacecraft_in_body_km, rotation, rotation, range_km=pose.range_km)
    spacecraft, body = (v / LIGHT_KM_PER_S for v in (pose.spacecraft_velocity_km_s, pose.target_velocity_km_s))
    centre = pose.target_from_spacecraft_km / pose.range_km
    length = float(np.linalg.norm(centre - spacecraft))
    to_centre = (centre - spacecraft) / length + body
    # |r| of a vector r = (x, y, 1) in the map, by its part along the centre's direction: exact on the limb's cone.
    secant = 1.0 + 0.5 * ((target.mean_radius_km if target else 0.0) / pose.range_km) ** 2
    true_from_apparent = np.eye(3) - np.outer(spacecraft - length * body, secant * centre)
    return Sight(
        spacecraft_km=pose.body_from_j2000 @ (-pose.range_km * to_centre),
        body_from_camera=pose.body_from_j2000 @ true_from_apparent @ pose.camera_from_j2000.T,
        apparent_from_camera=rotation,
        range_scale=1.0 / float(np.linalg.norm(to_centre)),
        range_km=pose.range_km,
        turn_deg_per_km=_rotation_rate_deg_per_s(target) / LIGHT_KM_PER_S,
    )


def _rotation_rate_deg_per_s(target: Target | None) -> float:
    rates = target.rotation.prime_meridian_deg if target and target.rotation else ()
    return rates[1] / SECONDS_PER_DAY if len(rates) > 1 else 0.0
