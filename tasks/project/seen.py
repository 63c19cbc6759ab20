"""What pixels see, point by point: the common ground of ellipsoids and shape models, from which every plane follows."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.backplanes import POINT
from tasks.project.rays import dot, sun_in_radii
from tasks.project.sight import Sight, sight_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Seen:
    """Surface points under n pixels, all body-fixed. points_km, normals (outward, of any length), to_camera (the
    direction from which the camera sees the point, of any length): (n, 3). lit: (n,), what the Sun's centre reaches;
    None on a convex body, where incidence below 90 says it."""

    pose: Pose
    camera: Camera
    target: Target
    points_km: Array
    normals: Array
    to_camera: Array
    lit: NDArray[np.bool_] | None = None

    @cached_property
    def sight(self) -> Sight:
        """How the spacecraft sees the body."""
        return sight_of(self.pose, self.target)

    @cached_property
    def sun_km(self) -> Array:
        """The Sun (3,). Raises RefusedError when it lies inside the target."""
        return sun_in_radii(self.pose, self.target) * np.asarray(self.target.radii_km)

    @cached_property
    def to_sun(self) -> Array:
        """From each point (n, 3) km."""
        return self.sun_km - self.points_km

    @cached_property
    def to_spacecraft(self) -> Array:
        """From each point along its line of sight (n, 3) km."""
        return self.sight.spacecraft_km - self.points_km

    @cached_property
    def range_km(self) -> Array:
        """Light distance (n,)."""
        return self.sight.range_scale * np.sqrt(dot(self.to_spacecraft, self.to_spacecraft))[:, 0]

    @cached_property
    def latitude(self) -> Array:
        """Planetocentric, degrees (n,)."""
        x, y, z = self.points_km.T
        return np.degrees(np.arctan2(z, np.hypot(x, y)))

    @cached_property
    def longitude(self) -> Array:
        """East, degrees in [0, 360), of when the light left the point (n,)."""
        x, y, _ = self.points_km.T
        turn = self.sight.turn_deg_per_km * (self.range_km - self.sight.range_km)
        longitude = (np.degrees(np.arctan2(y, x)) + turn) % 360.0
        return np.where(longitude >= 360.0, 0.0, longitude)

    @cached_property
    def incidence(self) -> Array:
        """Degrees (n,)."""
        return angle_deg(self.normals, self.to_sun)

    @cached_property
    def emission(self) -> Array:
        """Degrees (n,), from the apparent direction."""
        return angle_deg(self.normals, self.to_camera)

    @cached_property
    def phase(self) -> Array:
        """Degrees (n,), from the apparent direction."""
        return angle_deg(self.to_camera, self.to_sun)

    @cached_property
    def resolution_km(self) -> Array:
        """Longer side of the pixel's footprint (n,)."""
        lengths = np.sqrt(dot(self.to_spacecraft, self.to_spacecraft) * dot(self.normals, self.normals))
        cosine = np.abs(dot(self.normals, self.to_spacecraft)) / lengths
        return self.range_km / self.camera.focal_length_px / cosine[:, 0]

    @cached_property
    def sunlit(self) -> NDArray[np.bool_]:
        """Whether the Sun's centre stands above the horizon and nothing hides it (n,)."""
        return self.incidence < 90.0 if self.lit is None else self.lit & (self.incidence < 90.0)


def angle_deg(a: Array, b: Array) -> Array:
    """Angles (n,) between vectors (n, 3) of any length, exact also near 0 and 180."""
    cross = np.cross(a, b)
    return np.degrees(np.arctan2(np.sqrt(dot(cross, cross)), dot(a, b)))[:, 0]


def scattered(on_body: NDArray[np.bool_], seen: Seen, planes: Sequence[str]) -> dict[str, Array]:
    """`planes` of what is seen as arrays of on_body's shape, NaN where it is False."""
    out = {}
    for name in planes:
        out[name] = np.full(on_body.shape, np.nan)
        out[name][on_body] = seen.points_km[:, POINT.index(name)] if name in POINT else getattr(seen, name)
    return out
