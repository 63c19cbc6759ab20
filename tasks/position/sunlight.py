"""The Sun as a point of the surface sees it, which is carried along by the body's turning."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tasks.project.seen import Seen

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SunlitPoints(Seen):
    """`Seen`, but the Sun's direction is displaced by the aberration of each point's own velocity, as SPICE's ILUMIN
    has it: up to 1.4e-5 degrees on Io, 2.5e-3 on Jupiter. Without velocities in the pose nothing is displaced."""

    @cached_property
    def to_sun(self) -> Array:
        """From each point (n, 3) km."""
        straight = self.sun_km - self.points_km
        per_km = np.radians(self.sight.turn_deg_per_km)  # angular velocity over speed of light
        x, y, _ = self.points_km.T
        velocity = per_km * np.stack([-y, x, np.zeros_like(x)], axis=-1)
        return straight + np.linalg.norm(straight, axis=-1, keepdims=True) * velocity


def sunlit_points(seen: Seen) -> SunlitPoints:
    """The same points with the displaced Sun."""
    return SunlitPoints(**{field.name: getattr(seen, field.name) for field in fields(Seen)})
