"""What an image's pixels see, as planes of the image's shape (backplanes), and the names of the planes."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera

Array = NDArray[np.float64]
Window = tuple[int, int, int, int]

PLANES = ("latitude", "longitude", "incidence", "emission", "phase", "range_km", "resolution_km")
ANGLES = PLANES[:5]
POINT = ("x_km", "y_km", "z_km")  # the surface point, body-fixed
SUNLIT = "sunlit"  # of shape models only: 1 where the Sun's centre reaches, else 0
KNOWN_PLANES = PLANES + POINT


@dataclass(frozen=True)
class Backplanes:
    """What the pixels of `window` see; each plane float64 (ny, nx), NaN off the body.

    window: (x0, y0, x1, y1), the half-open range of undistorted pixels. latitude (planetocentric), longitude (east,
    [0, 360)), incidence, emission (from the ellipsoid's normal) and phase in degrees. range_km: spacecraft to surface
    point. resolution_km: the longer side of a pixel's footprint, range / focal_length_px / cos(emission), as ISIS'
    oblique pixel resolution. x_km, y_km, z_km, on request: the surface point, body-fixed. A plane that was not
    requested is a KeyError.
    """

    window: Window
    planes: Mapping[str, Array]

    def __getitem__(self, name: str) -> Array:
        return self.planes[name]

    @property
    def latitude(self) -> Array:
        """Planetocentric latitude, degrees."""
        return self.planes["latitude"]

    @property
    def longitude(self) -> Array:
        """East longitude in [0, 360), degrees."""
        return self.planes["longitude"]

    @property
    def incidence(self) -> Array:
        """Angle between the normal and the Sun, degrees; above 90 on the night side."""
        return self.planes["incidence"]

    @property
    def emission(self) -> Array:
        """Angle between the normal and the spacecraft, degrees."""
        return self.planes["emission"]

    @property
    def phase(self) -> Array:
        """Angle Sun - surface point - spacecraft, degrees."""
        return self.planes["phase"]

    @property
    def range_km(self) -> Array:
        """Distance from spacecraft to surface point, km."""
        return self.planes["range_km"]

    @property
    def resolution_km(self) -> Array:
        """Longer side of the pixel's footprint, km."""
        return self.planes["resolution_km"]

    @property
    def on_body(self) -> NDArray[np.bool_]:
        """Whether each pixel's centre sees the body (ny, nx)."""
        return np.isfinite(next(iter(self.planes.values())))

    @property
    def illuminated(self) -> NDArray[np.bool_]:
        """Whether each pixel's centre sees the day side (ny, nx): incidence below 90; on a shape model nothing in the
        Sun's way either, if the plane `sunlit` was requested."""
        return self.planes[SUNLIT] > 0 if SUNLIT in self.planes else self.incidence < 90.0


def full_window(camera: Camera) -> Window:
    """The whole undistorted frame."""
    return (0, 0, *camera.size_px)
