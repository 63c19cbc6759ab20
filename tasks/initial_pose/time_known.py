"""What the time of an exposure adds to a pose that was found in the image: the Sun's direction, and with kernels the
range."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from catalog.spice_pose import LIGHT_KM_PER_S, pose_parts_from_spice
from tasks.simulate import Scene

Array = NDArray[np.float64]

# Planets by the hundreds of their bodies' NAIF ids, as astropy names them.
PLANETS = {1: "mercury", 2: "venus", 3: "earth", 4: "mars", 5: "jupiter", 6: "saturn", 7: "uranus", 8: "neptune"}


@dataclass(frozen=True)
class ByTime:
    """sun_from_target_km: (3,) J2000; None where nothing knows it. range_km: of the spacecraft's trajectory, None
    without kernels. source: `spice`, `ephemeris`, or None."""

    sun_from_target_km: Array | None = None
    range_km: float | None = None
    source: str | None = None


def known_by_time(pose: Pose, scene: Scene, et: float | None, kernels: Iterable[Path]) -> ByTime:
    """The Sun from kernels that cover the time, else from the planet's mean orbit (astropy's built-in ephemeris, good
    to an arc minute; a moon is then where its planet is, 0.1 deg at most); the range from kernels alone."""
    if et is None:
        return ByTime()
    parts = pose_parts_from_spice(scene.camera, scene.target, et, kernels, pose.range_km / LIGHT_KM_PER_S).parts
    position = parts.target_from_spacecraft_km
    range_km = None if position is None else float(np.linalg.norm(position))
    if parts.sun_from_target_km is not None:
        return ByTime(np.asarray(parts.sun_from_target_km), range_km, "spice")
    sun = sun_by_orbit(scene.target.naif_id, et)
    return ByTime(sun, range_km, "ephemeris" if sun is not None else None)


def radius_by_time(scene: Scene, et: float | None, kernels: Iterable[Path]) -> float | None:
    """Radius of the target's disk in the middle of the frame, pixels, by the range of kernels that cover the time; None
    where none does."""
    position = None
    if et is not None:
        position = pose_parts_from_spice(scene.camera, scene.target, et, kernels).parts.target_from_spacecraft_km
    if position is None:
        return None
    range_km, radius_km = float(np.linalg.norm(position)), (scene.target.radii_km[0] + scene.target.radii_km[1]) / 2
    if range_km <= radius_km:
        return None
    return float(scene.camera.focal_length_px * radius_km / np.sqrt(range_km**2 - radius_km**2))


def sun_by_orbit(naif_id: int, et: float) -> Array | None:
    """The Sun (3,) relative to a planet or a planet's moon, km, J2000, at TDB seconds past J2000; None for others."""
    planet = PLANETS.get(naif_id // 100) if 100 < naif_id < 1000 else None
    if planet is None:
        return None
    from astropy.coordinates import get_body_barycentric, solar_system_ephemeris
    from astropy.time import Time

    when = Time(2451545.0, et / 86400.0, format="jd", scale="tdb")
    with solar_system_ephemeris.set("builtin"):
        apart = get_body_barycentric("sun", when) - get_body_barycentric(planet, when)
    return np.asarray(apart.xyz.to_value("km"), np.float64)


def sun_apart_deg(pose: Pose, sun_from_target_km: Array) -> float:
    """Angle between a pose's Sun and another (3,), degrees."""
    a, b = (v / np.linalg.norm(v) for v in (pose.sun_from_target_km, sun_from_target_km))
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))
