"""Planes beyond the cube's own: other latitudes and longitudes, azimuths, local time, sky directions, limb distance.

Azimuths as ISIS' phocube defines them. Image azimuths (NorthAzimuth, SunAzimuth, SpacecraftAzimuth; Camera::
ComputeAzimuth): the direction in the image in which a point on the surface moves that goes towards the north pole, the
sub-solar or the sub-spacecraft point, at right angles to its radius; degrees clockwise from the +x axis (3 o'clock),
0-360. Ground azimuths (SubSolarGroundAzimuth, SubSpacecraftGroundAzimuth): of the great circle to that point, clockwise
from north.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import Target
from tasks.project.limb_distance import limb_distance_km
from tasks.project.rays import dot
from tasks.project.seen import Seen

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plane:
    """One plane. of: the values (n,) of what pixels see. units: of CF. valid_range: inclusive."""

    name: str
    units: str
    long_name: str
    of: Callable[[Seen], Array]
    valid_range: tuple[float, float] | None = None


@dataclass(frozen=True)
class SkyPlane:
    """A plane of every pixel, on the body or not. of: the values (n,) of undistorted pixels (n, 2)."""

    name: str
    units: str
    long_name: str
    of: Callable[[Pose, Camera, Target, Array], Array]
    valid_range: tuple[float, float] | None = None


def latitude_graphic(seen: Seen) -> Array:
    """Planetographic latitude: tan = (a / c)^2 tan(planetocentric), a the first equatorial radius, as ISIS and, on a
    spheroid's surface, SPICE's RECPGR have it."""
    a, _, c = seen.target.radii_km
    x, y, z = seen.points_km.T
    return np.degrees(np.arctan2(z * a * a, np.hypot(x, y) * c * c))


def longitude_west(seen: Seen) -> Array:
    """Positive westward, [0, 360)."""
    return np.where(seen.longitude > 0.0, 360.0 - seen.longitude, 0.0)


def longitude_180(seen: Seen) -> Array:
    """Positive eastward, [-180, 180)."""
    return np.where(seen.longitude >= 180.0, seen.longitude - 360.0, seen.longitude)


def longitude_graphic(seen: Seen) -> Array:
    """Planetographic: west where the body turns eastward as seen from north, else east; Earth, Moon and Sun east."""
    rotation = seen.target.rotation
    rate = rotation.prime_meridian_deg[1] if rotation and len(rotation.prime_meridian_deg) > 1 else 1.0
    east = rate < 0 or seen.target.naif_id in (10, 301, 399)
    return seen.longitude if east else longitude_west(seen)


def local_solar_time(seen: Seen) -> Array:
    """Hours: 12 plus the longitude east of the sub-solar point over 15."""
    sun_longitude = np.degrees(np.arctan2(seen.sun_km[1], seen.sun_km[0]))
    return (12.0 + (seen.longitude - sun_longitude) / 15.0) % 24.0


def image_azimuth(seen: Seen, towards_km: Array) -> Array:
    """Of the surface's direction towards a point (3,), degrees clockwise from +x; NaN at that point itself."""
    up = seen.points_km / np.sqrt(dot(seen.points_km, seen.points_km))
    along = towards_km - up * (up @ towards_km)[:, None]
    camera_from_body = np.linalg.inv(seen.sight.body_from_camera)
    x, y, z = (-seen.to_spacecraft @ camera_from_body.T).T
    dx, dy, dz = (along @ camera_from_body.T).T
    across, down = dx * z - x * dz, dy * z - y * dz
    azimuth = np.degrees(np.arctan2(down, across)) % 360.0
    return np.where(np.hypot(across, down) > 1e-9 * np.linalg.norm(towards_km) * z, azimuth, np.nan)


def ground_azimuth(seen: Seen, towards_km: Array) -> Array:
    """Of the great circle towards a point (3,), degrees clockwise from north."""
    latitude, longitude = np.radians(seen.latitude), np.radians(np.degrees(np.arctan2(*seen.points_km.T[1::-1])))
    to_latitude = np.arctan2(towards_km[2], np.hypot(*towards_km[:2]))
    off = np.arctan2(towards_km[1], towards_km[0]) - longitude
    east = np.sin(off) * np.cos(to_latitude)
    north = np.cos(latitude) * np.sin(to_latitude) - np.sin(latitude) * np.cos(to_latitude) * np.cos(off)
    return np.degrees(np.arctan2(east, north)) % 360.0


def _north(seen: Seen) -> Array:
    return np.array([0.0, 0.0, seen.target.radii_km[2]])


def _sub_point(seen: Seen, direction_km: Array) -> Array:
    return direction_km / np.linalg.norm(direction_km) * seen.target.mean_radius_km


def right_ascension(pose: Pose, camera: Camera, _: Target, xy_px: Array) -> Array:
    """Apparent, J2000, [0, 360)."""
    x, y, _z = (camera.ray(xy_px) @ pose.camera_from_j2000).T
    return np.degrees(np.arctan2(y, x)) % 360.0


def declination(pose: Pose, camera: Camera, _: Target, xy_px: Array) -> Array:
    """Apparent, J2000."""
    x, y, z = (camera.ray(xy_px) @ pose.camera_from_j2000).T
    return np.degrees(np.arctan2(z, np.hypot(x, y)))


TURN = (0.0, 360.0)

PLANES_OF_SURFACE = (
    Plane("latitude_graphic", "degree", "planetographic latitude", latitude_graphic, (-90.0, 90.0)),
    Plane("longitude_graphic", "degree", "planetographic longitude, 0-360", longitude_graphic, TURN),
    Plane("longitude_west", "degree", "longitude, positive westward, 0-360", longitude_west, TURN),
    Plane("longitude_180", "degree", "longitude, positive eastward, from -180 to 180", longitude_180, (-180.0, 180.0)),
    Plane("north_azimuth", "degree", "image azimuth of north, clockwise from +x",
          lambda s: image_azimuth(s, _north(s)), TURN),
    Plane("sun_azimuth", "degree", "image azimuth of the sub-solar point, clockwise from +x",
          lambda s: image_azimuth(s, _sub_point(s, s.sun_km)), TURN),
    Plane("spacecraft_azimuth", "degree", "image azimuth of the sub-spacecraft point, clockwise from +x",
          lambda s: image_azimuth(s, _sub_point(s, s.sight.spacecraft_km)), TURN),
    Plane("sun_ground_azimuth", "degree", "azimuth of the sub-solar point, clockwise from north",
          lambda s: ground_azimuth(s, s.sun_km), TURN),
    Plane("spacecraft_ground_azimuth", "degree", "azimuth of the sub-spacecraft point, clockwise from north",
          lambda s: ground_azimuth(s, s.sight.spacecraft_km), TURN),
    Plane("local_solar_time", "h", "local solar time", local_solar_time, (0.0, 24.0)),
    Plane("shadow", "1", "1 where the Sun's centre is below the horizon or hidden, else 0",
          lambda s: (~s.sunlit).astype(np.float64), (0.0, 1.0)),
)  # fmt: skip
PLANES_OF_SKY = (
    SkyPlane("right_ascension", "degree", "right ascension of the line of sight, J2000", right_ascension, TURN),
    SkyPlane("declination", "degree", "declination of the line of sight, J2000", declination, (-90.0, 90.0)),
    SkyPlane("limb_distance_km", "km", "distance of the line of sight from the ellipsoid; NaN on the body",
             limb_distance_km, (0.0, 1e11)),
)  # fmt: skip
MORE_PLANES: dict[str, Plane | SkyPlane] = {plane.name: plane for plane in (*PLANES_OF_SURFACE, *PLANES_OF_SKY)}


@dataclass(frozen=True)
class SigmaPart:
    """A part of the cube's uncertainty of latitude or longitude; the squares of a coordinate's parts add up to that of
    the whole. coordinate: latitude or longitude; part: pose, distortion or map_frame."""

    name: str
    units: str
    long_name: str
    coordinate: str
    part: str
    valid_range: tuple[float, float] | None = None


PARTS = {
    "pose": "pose without the map's frame",
    "distortion": "place of the pixel itself (distortion)",
    "map_frame": "place of the base map in the body's frame",
}
SIGMA_PARTS = {
    f"{name}_uncertainty_{part}": SigmaPart(
        f"{name}_uncertainty_{part}", "degree", f"1-sigma of the {name} from the {what}", name, part, (0.0, limit)
    )
    for name, limit in (("latitude", 90.0), ("longitude", 180.0))
    for part, what in PARTS.items()
}
# All that `planetpose planes` can add.
ADDED_PLANES: dict[str, Plane | SkyPlane | SigmaPart] = {**MORE_PLANES, **SIGMA_PARTS}


def planes_named(text: str) -> tuple[str, ...]:
    """Names of ADDED_PLANES in a comma-separated list, or all of them for `all`. Raises RefusedError for others."""
    names = tuple(ADDED_PLANES) if text.strip() == "all" else tuple(part.strip() for part in text.split(",") if part)
    unknown = [name for name in names if name not in ADDED_PLANES]
    if unknown or not names:
        raise RefusedError(
            Reason.PLANE_UNKNOWN,
            f"there is no plane {', '.join(unknown) or text!r}.",
            f"Known are {', '.join(ADDED_PLANES)}; or all. The others are in every cube.",
        )
    return names


def more_planes(
    pose: Pose, camera: Camera, target: Target, xy_px: ArrayLike, planes: Sequence[str] = tuple(MORE_PLANES)
) -> dict[str, Array]:
    """`planes` of MORE_PLANES for undistorted pixels (..., 2): each (...), NaN off the body and where a place is NaN;
    those of the sky everywhere but limb_distance_km, which is NaN on the body.

    Raises RefusedError when the pose puts spacecraft or Sun inside the target; KeyError for an unknown plane.
    """
    from tasks.project.pixels import seen_at

    xy = np.asarray(xy_px, dtype=np.float64)
    on_body, seen = seen_at(pose, camera, target, xy, shadows="shadow" in planes)
    out = {}
    for name in planes:
        plane = MORE_PLANES[name]
        values = np.full(on_body.shape, np.nan)
        if isinstance(plane, Plane):
            values[on_body] = plane.of(seen)
        else:
            known = np.isfinite(xy[..., 0])
            values[known] = plane.of(pose, camera, target, xy[known])
        out[name] = np.where(on_body, np.nan, values) if name == "limb_distance_km" else values
    return out
