"""The four real images that every registration is tried on, and what their files do not say."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera, find_camera
from catalog.rotation import nearest_rotation
from catalog.spice import kernel_pool

# Archived C-matrix of f1636832: rows are the sample axis, the line axis and the boresight, in B1950 (JPL's VICAR logs).
C_MATRIX_OF_F1636832_B1950 = [
    [0.595661, 0.568173, 0.567773],
    [0.174710, 0.598289, -0.782002],
    [-0.784005, 0.565004, 0.257112],
]
ENCELADUS_RADIUS_KM, ENCELADUS_RADIUS_PX, SATURN_FROM_SUN_KM = 252.1, 293.0, 1.4e9


@dataclass(frozen=True)
class RealImage:
    """file: under images/ of the data folder. kernels: whether positions come from the data folder's kernels."""

    file: str
    title: str
    target: str | None = None
    kernels: bool = False

    def pose_parts(self) -> dict[str, Any] | None:
        """Content of the pose file that it needs, None when its label is enough."""
        if self.target == "io":
            return {"camera_from_j2000": orientation_of_f1636832().tolist()}
        if self.target == "enceladus":
            return rough_pose_of_enceladus(find_camera("cassini-nac"))
        return None


REAL_IMAGES = {
    "C0552809300R": RealImage("galileo/C0552809300R.IMG", "Europa, Galileo SSI"),
    "f1636832": RealImage("voyager/f1636832.raw", "Io, Voyager 1 NAC", "io", kernels=True),
    "lor_0299140073_0x630_sci": RealImage("new_horizons/lor_0299140073_0x630_sci.fit", "Pluto, New Horizons LORRI"),
    "N1489034146_2": RealImage("cassini/N1489034146_2.IMG", "Enceladus, Cassini NAC", "enceladus"),
}


def orientation_of_f1636832() -> NDArray[np.float64]:
    """camera_from_j2000 (3, 3) of the archived C-matrix."""
    import spiceypy

    with kernel_pool([]):
        b1950_from_j2000 = spiceypy.pxform("J2000", "B1950", 0.0)
    return nearest_rotation(nearest_rotation(C_MATRIX_OF_F1636832_B1950) @ b1950_from_j2000)


def rough_pose_of_enceladus(
    camera: Camera,
    phase_deg: float = 45.0,
    sun_tilt_deg: float = 0.0,
    range_factor: float = 1.0,
    longitude_deg: float = 0.0,
    latitude_deg: float = 0.0,
    roll_deg: float = 0.0,
) -> dict[str, Any]:
    """What somebody writes who sees the picture and knows the camera: range from the disk's size, Sun from the left
    (tilted upward), north up (rolled clockwise), any sub-spacecraft point. The camera frame stands for J2000."""
    phase, tilt, roll, latitude, longitude = np.radians(
        [phase_deg, sun_tilt_deg, roll_deg, latitude_deg, longitude_deg]
    )
    to_viewer = np.array([0.0, 0.0, -1.0])
    to_left = np.array([-np.cos(tilt), -np.sin(tilt), 0.0])
    up = np.array([np.sin(roll), -np.cos(roll), 0.0])
    north = np.cos(latitude) * up + np.sin(latitude) * to_viewer
    meridian = np.cos(latitude) * to_viewer - np.sin(latitude) * up  # the equator's point below the spacecraft
    east = np.cross(north, meridian)
    prime = np.cos(longitude) * meridian - np.sin(longitude) * east
    range_km = camera.focal_length_px * ENCELADUS_RADIUS_KM / ENCELADUS_RADIUS_PX * range_factor
    return {
        "camera_from_j2000": np.eye(3).tolist(),
        "target_from_spacecraft_km": [0.0, 0.0, range_km],
        "sun_from_target_km": (SATURN_FROM_SUN_KM * (np.cos(phase) * to_viewer + np.sin(phase) * to_left)).tolist(),
        "body_from_j2000": np.stack([prime, np.cross(north, prime), north]).tolist(),
    }
