"""A ray caster of several ellipsoids with an extended Sun and absorbing rings, independent of the program's geometry.

The penumbra is counted: each surface point looks at many points of the Sun's disk. Positions are those that are seen;
no light time, no aberration.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lab.honesty.caster import Hits, View, met
from lab.honesty.laws import radiance
from lab.honesty.solids import Solid, sample

Array = NDArray[np.float64]
SUN_RADIUS_KM = 695_700.0
STRIP_RAYS = 200_000
RIM_POINTS = 12


@dataclass(frozen=True)
class Annulus:
    """Of rings: radii, km; optical depth along the normal; brightness as seen face on, relative to the solids'."""

    inner_km: float
    outer_km: float
    depth: float
    brightness: float = 0.5


@dataclass(frozen=True)
class Globe:
    """One body: a solid, its NAIF id and rings in its equator."""

    naif_id: int
    solid: Solid
    rings: tuple[Annulus, ...] = field(default=())


@dataclass(frozen=True)
class Cast:
    """Along rays (n,): radiance, what is hit first (0: nothing), and the covered fraction of the Sun there (NaN)."""

    radiance: Array
    body_id: NDArray[np.int32]
    shadow: Array


def rendered(
    view: View, globes: Sequence[Globe], sun_km: Array, sun_points: int = 19, lamps: "Lamps | None" = None
) -> NDArray[np.float32]:
    """Radiance (rows * oversample, columns * oversample) under a Sun at `sun_km` (3,), J2000, from the spacecraft;
    lamps: what else lights the first globe."""
    wide, high = view.columns * view.oversample, view.rows * view.oversample
    picture = np.zeros((high, wide), np.float32)
    step = max(1, STRIP_RAYS // wide)
    for first in range(0, high, step):
        last = min(first + step, high)
        light = cast(view.rays(first, last), globes, sun_km, sun_points, lamps).radiance
        picture[first:last] = light.reshape(last - first, wide)
    return picture


@dataclass(frozen=True)
class Lamps:
    """Patches of another globe's sunlit surface, as points: places (n, 3), J2000, from the spacecraft; what each throws
    on a surface at 1 km that it shines on straight, relative to sunlight, (n,)."""

    places_km: Array
    power: Array


def lamps_of(globe: Globe, albedo: float, towards_km: Array, sun_km: Array, count: int = 400) -> Lamps:
    """Those of a sphere whose patches scatter as Lambert's surface does, of a geometric albedo, that see the place
    `towards_km` (3,): a sphere's geometric albedo is two thirds of its surface's reflectance."""
    radius, centre = float(globe.solid.radii_km.max()), globe.solid.centre_km
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    normals = np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], axis=1)
    places = centre + radius * normals
    to_sun = (sun_km - centre) / np.linalg.norm(sun_km - centre)
    to_place = towards_km - places
    to_place /= np.linalg.norm(to_place, axis=1)[:, None]
    lit, seen = np.maximum(normals @ to_sun, 0), np.maximum((normals * to_place).sum(axis=1), 0)
    nearer = float(((towards_km - sun_km) ** 2).sum() / ((centre - sun_km) ** 2).sum())
    power = 1.5 * albedo / np.pi * lit * seen * 4 * np.pi * radius**2 / count * nearer
    return Lamps(places[power > 0], power[power > 0])


def lamp_light(hits: Hits, rays: Array, solid: Solid, lamps: Lamps) -> Array:
    """Radiance (n,) of points that lamps light."""
    light = np.zeros(len(hits.rays))
    for place, power in zip(lamps.places_km, lamps.power, strict=True):
        away = solid.body_from_j2000 @ (place - solid.centre_km) - hits.points_km
        light += power / (away**2).sum(axis=1) * surface_light(hits, rays, solid, place)
    return light


def cast(rays: Array, globes: Sequence[Globe], sun_km: Array, sun_points: int = 37, lamps: Lamps | None = None) -> Cast:
    """What rays (n, 3), unit vectors of J2000, meet."""
    nearest, light = np.full(len(rays), np.inf), np.zeros(len(rays))
    body_id, shadow = np.zeros(len(rays), np.int32), np.full(len(rays), np.nan)
    for globe in globes:
        hits = met(rays, globe.solid)
        closer = hits.distance_km < nearest[hits.rays]
        seen = Hits(*(getattr(hits, name)[closer] for name in ("rays", "distance_km", "points_km", "normals")))
        if not len(seen.rays):
            continue
        covered = covered_sun(seen.points_km, globe, globes, sun_km, sun_points)
        light[seen.rays] = surface_light(seen, rays[seen.rays], globe.solid, sun_km) * (1 - covered)
        if lamps is not None and globe is globes[0]:
            light[seen.rays] += lamp_light(seen, rays[seen.rays], globe.solid, lamps)
        nearest[seen.rays], body_id[seen.rays], shadow[seen.rays] = seen.distance_km, globe.naif_id, covered
    for globe in globes:
        if globe.rings:
            light = through_rings(light, rays, nearest, globe, globes, sun_km)
    return Cast(light, body_id, shadow)


def surface_light(hits: Hits, rays: Array, solid: Solid, sun_km: Array) -> Array:
    """Radiance (n,) of sunlit points by the solid's law."""
    to_sun = solid.body_from_j2000 @ (sun_km - solid.centre_km) - hits.points_km
    to_sun /= np.linalg.norm(to_sun, axis=1)[:, None]
    to_camera = -(rays @ solid.body_from_j2000.T)
    mu0, mu = (hits.normals * to_sun).sum(axis=1), (hits.normals * to_camera).sum(axis=1)
    phase = np.arccos(np.clip((to_camera * to_sun).sum(axis=1), -1, 1))
    light = solid.brightness * radiance(solid.law, solid.parameters, mu0, mu, phase)
    if solid.texture is not None:
        light = light * sample(solid.texture, hits.points_km @ solid.map_from_body.T)
    return np.asarray(light)


def covered_sun(points_km: Array, globe: Globe, globes: Sequence[Globe], sun_km: Array, sun_points: int) -> Array:
    """Fraction (n,) of the Sun's disk that others cover at points (n, 3) of a globe, and of its light rings take."""
    points = points_km @ globe.solid.body_from_j2000 + globe.solid.centre_km
    covered = np.zeros(len(points))
    casters = [other for other in globes if other is not globe and near_sunlight(other, globe, sun_km)]
    rings = [other for other in globes if other.rings]
    if not casters and not rings:
        return covered
    through = 1 - lost(points, sun_km, (), rings)  # the Sun's disk is narrow at the rings
    if not casters:
        return np.asarray(1 - through)
    disk = sun_disk(sun_km, globe.solid.centre_km, sun_points)
    few = np.concatenate([disk[:1], disk[-RIM_POINTS:]])
    # Where the Sun's rim and middle are all covered, or none of them, so is what lies between.
    covers = np.stack([lost(points, place, casters, ()) for place in few])
    covered = covers.mean(axis=0)
    partly = np.ptp(covers, axis=0) > 1e-3
    if any(smaller_than_sun(other, globe, sun_km) for other in casters):
        partly[:] = True
    if partly.any():
        covered[partly] = np.mean([lost(points[partly], place, casters, ()) for place in disk], axis=0)
    return np.asarray(1 - through * (1 - covered))


def smaller_than_sun(other: Globe, globe: Globe, sun_km: Array) -> bool:
    """Whether another solid, seen from a globe, may be smaller than the Sun."""
    away = float(np.linalg.norm(other.solid.centre_km - globe.solid.centre_km))
    sun = SUN_RADIUS_KM / float(np.linalg.norm(sun_km - globe.solid.centre_km))
    return bool(other.solid.radii_km.min() / away < 1.5 * sun)


def lost(points: Array, place: Array, casters: Sequence[Globe], rings: Sequence[Globe]) -> Array:
    """What share (n,) of the light from a place of the Sun does not reach points (n, 3)."""
    direction = place - points
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    passed = np.ones(len(points))
    for other in casters:
        passed[blocked(points, direction, other.solid)] = 0
    for other in rings:
        passed *= np.exp(-ring_depth(points, direction, other, np.inf))
    return np.asarray(1 - passed)


def near_sunlight(other: Globe, globe: Globe, sun_km: Array) -> bool:
    """Whether another solid may stand between a globe and the Sun at all."""
    axis = sun_km - globe.solid.centre_km
    distance = float(np.linalg.norm(axis))
    away = other.solid.centre_km - globe.solid.centre_km
    along = float(away @ axis) / distance
    across = float(np.linalg.norm(away - along * axis / distance))
    reach = float(other.solid.radii_km.max() + globe.solid.radii_km.max())
    return along > -reach and across < reach + SUN_RADIUS_KM * max(along, 0.0) / distance


def sun_disk(sun_km: Array, from_km: Array, count: int) -> Array:
    """Points (count, 3) spread evenly over the Sun's disk as seen from `from_km` (a sunflower)."""
    axis = (sun_km - from_km) / np.linalg.norm(sun_km - from_km)
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    k = np.arange(count) + 0.5
    radius, angle = SUN_RADIUS_KM * np.sqrt(k / count), np.pi * (1 + 5**0.5) * k
    other = np.cross(axis, side)
    return sun_km + radius[:, None] * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other)


def blocked(points: Array, direction: Array, solid: Solid) -> NDArray[np.bool_]:
    """Which rays from points (n, 3) in directions (n, 3), J2000, meet a solid."""
    start = (points - solid.centre_km) @ solid.body_from_j2000.T / solid.radii_km
    ray = direction @ solid.body_from_j2000.T / solid.radii_km
    a, b, c = (ray**2).sum(axis=1), (start * ray).sum(axis=1), (start**2).sum(axis=1) - 1
    return np.asarray((b < 0) & (b**2 - a * c > 0))


def ring_depth(points: Array, direction: Array, globe: Globe, farthest: Array | float) -> Array:
    """Optical depth (n,) of a globe's rings along rays from points (n, 3), J2000, up to a distance."""
    depth, _ = _rings_met(points, direction, globe, farthest)
    return depth


def _rings_met(points: Array, direction: Array, globe: Globe, farthest: Array | float) -> tuple[Array, Array]:
    """Optical depths and brightnesses (n,) of the rings that rays meet."""
    turn = globe.solid.body_from_j2000
    start, ray = (points - globe.solid.centre_km) @ turn.T, direction @ turn.T
    with np.errstate(divide="ignore", invalid="ignore"):
        along = -start[:, 2] / ray[:, 2]
        radius = np.linalg.norm((start + along[:, None] * ray)[:, :2], axis=1)
    depth, bright = np.zeros(len(start)), np.zeros(len(start))
    there = np.isfinite(along) & (along > 0) & (along < farthest)
    for ring in globe.rings:
        on = there & (radius >= ring.inner_km) & (radius < ring.outer_km)
        depth[on] = ring.depth / np.abs(ray[on, 2])
        bright[on] = ring.brightness
    return depth, bright


def through_rings(
    light: Array, rays: Array, nearest: Array, globe: Globe, globes: Sequence[Globe], sun_km: Array
) -> Array:
    """Light (n,) along rays (n, 3) after a globe's rings took theirs away and added what they scatter, where they are
    in sunlight and nearer than what is behind."""
    origin = np.zeros_like(rays)
    depth, bright = _rings_met(origin, rays, globe, nearest)
    met_there = depth > 0
    if met_there.any():
        turn = globe.solid.body_from_j2000
        start, ray = -turn @ globe.solid.centre_km, rays[met_there] @ turn.T
        points = rays[met_there] * (-start[2] / ray[:, 2])[:, None]
        to_sun = np.broadcast_to((sun_km - points[:1]) / np.linalg.norm(sun_km - points[0]), points.shape)
        lit = np.ones(len(points))
        for other in globes:
            lit[blocked(points, to_sun, other.solid)] = 0
        passed = np.exp(-depth[met_there])
        light = light.copy()
        light[met_there] = light[met_there] * passed + bright[met_there] * lit * (1 - passed)
    return light
