"""A small ray caster: ellipsoids that hide and shadow each other, seen by a pinhole camera. Plain numpy."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lab.honesty.laws import radiance
from lab.honesty.solids import Solid, Terrain, sample

Array = NDArray[np.float64]
Shift = Callable[[Array, Array], tuple[Array, Array]]
# So few that what is computed of them stays in the processor's cache: three times as fast as with 400 000.
STRIP_RAYS = 30_000
MARCH_STEPS = 32
BISECTIONS = 18
TERRAIN_ROUNDS = 4


@dataclass(frozen=True)
class View:
    """Which pixels are rendered: x0, y0, columns, rows of the frame (they may lie outside of it), each cut into
    `oversample` x `oversample` rays. centre_px: where the boresight falls. shift: where the optics put what an ideal
    camera would have at (x, y): from a place in the picture to the ideal place, pixels; None leaves it."""

    camera_from_j2000: Array
    focal_px: float
    centre_px: tuple[float, float]
    x0: int
    y0: int
    columns: int
    rows: int
    oversample: int
    shift: Shift | None = None

    def rays(self, first: int, last: int) -> Array:
        """Unit vectors (n, 3), J2000, of the rays of the fine rows `first` to `last`."""
        fine = self.oversample
        x = self.x0 - 0.5 + (np.arange(self.columns * fine) + 0.5) / fine
        y = self.y0 - 0.5 + (np.arange(first, last) + 0.5) / fine
        x, y = (grid.ravel() for grid in np.meshgrid(x, y))
        if self.shift is not None:
            x, y = self.shift(x, y)
        return rays_of(self.camera_from_j2000, self.focal_px, self.centre_px, x, y)


@dataclass(frozen=True)
class Hits:
    """Where rays meet a solid: which rays (n,), distances km (n,), points and outward normals (n, 3) in the body's
    frame."""

    rays: NDArray[np.intp]
    distance_km: Array
    points_km: Array
    normals: Array


def rays_of(camera_from_j2000: Array, focal_px: float, centre_px: tuple[float, float], x: Array, y: Array) -> Array:
    """Unit vectors (n, 3), J2000, of places (x, y) in the picture."""
    ray = np.stack([(x - centre_px[0]) / focal_px, (y - centre_px[1]) / focal_px, np.ones_like(x)], axis=1)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    return np.asarray(ray @ camera_from_j2000)


def render(view: View, solids: Sequence[Solid], sun: Array) -> NDArray[np.float32]:
    """Radiance (rows * oversample, columns * oversample) of `solids` under a Sun in direction `sun` (3,), J2000."""
    wide, high = view.columns * view.oversample, view.rows * view.oversample
    picture = np.zeros((high, wide), np.float32)
    step = max(1, STRIP_RAYS // wide)
    for first in range(0, high, step):
        last = min(first + step, high)
        picture[first:last] = cast(view.rays(first, last), solids, sun).reshape(last - first, wide)
    return picture


def cast(rays: Array, solids: Sequence[Solid], sun: Array) -> Array:
    """Radiance (n,) along rays (n, 3)."""
    nearest = np.full(len(rays), np.inf)
    light = np.zeros(len(rays))
    for solid in solids:
        hits = met(rays, solid)
        in_front = hits.distance_km < nearest[hits.rays]
        if in_front.any():
            seen = Hits(*(getattr(hits, name)[in_front] for name in ("rays", "distance_km", "points_km", "normals")))
            nearest[seen.rays] = seen.distance_km
            others = [other for other in solids if other is not solid]
            light[seen.rays] = shaded(seen, rays[seen.rays], solid, sun, others)
    return light


def met(rays: Array, solid: Solid) -> Hits:
    """The nearest point of `solid` on each ray that meets it."""
    start = -solid.body_from_j2000 @ solid.centre_km
    directions = rays @ solid.body_from_j2000.T
    if isinstance(solid.relief, Terrain):
        distance, chosen = _terrain_crossing(start, directions, solid.relief, solid.radii_km)
        points = start + distance[:, None] * directions[chosen]
        return Hits(chosen, distance, points, _relief_normals(points, solid))
    grown = 1.0 if solid.relief is None else 1.0 + _highest(solid)
    near, far, chosen = _crossings(start, directions, solid.radii_km * grown)
    directions = directions[chosen]
    if solid.relief is None:
        points = start + near[:, None] * directions
        normals = points / solid.radii_km**2
        return Hits(chosen, near, points, normals / np.linalg.norm(normals, axis=1, keepdims=True))
    distance, hit = _relief_crossing(start, directions, near, far, solid)
    points = start + distance[hit, None] * directions[hit]
    return Hits(chosen[hit], distance[hit], points, _relief_normals(points, solid))


def _crossings(start: Array, directions: Array, radii: Array) -> tuple[Array, Array, NDArray[np.intp]]:
    """Distances where rays enter and leave an ellipsoid, and which rays do, ahead of their start."""
    scaled, origin = directions / radii, start / radii
    a, b, c = (scaled**2).sum(axis=1), scaled @ origin, float(origin @ origin) - 1
    discriminant = b**2 - a * c
    chosen = np.flatnonzero((discriminant > 0) & (b < 0))
    root, a, b = np.sqrt(discriminant[chosen]), a[chosen], b[chosen]
    return (-b - root) / a, (-b + root) / a, chosen


def _terrain_crossing(
    start: Array, directions: Array, terrain: Terrain, radii: Array
) -> tuple[Array, NDArray[np.intp]]:
    """Distances of the first crossing of a slight relief, and which rays have one: of the ellipsoid that is as high as
    the terrain at the point, found anew there. A ray passes where it is nearest above the terrain."""
    _, _, chosen = _crossings(start, directions, radii * (1 + float(terrain.heights.max())))
    scaled, origin = directions[chosen] / radii, start / radii
    a, b, c = (scaled**2).sum(axis=1), scaled @ origin, float(origin @ origin)
    distance = -b / a
    hits = np.ones(len(chosen), bool)
    for number in range(TERRAIN_ROUNDS):
        points = start + distance[:, None] * directions[chosen]
        height = terrain.height(points / np.linalg.norm(points, axis=1, keepdims=True))
        left = b**2 - a * (c - (1 + height) ** 2)
        if number == 0:
            hits = left > 0
        distance = (-b - np.sqrt(np.maximum(left, 0.0))) / a
    return distance[hits], chosen[hits]


def _highest(solid: Solid) -> float:
    """An upper bound of the relief's height."""
    from lab.honesty.solids import even_directions

    return 1.1 * float(solid.relief.height(even_directions(4000)).max()) if solid.relief else 0.0


def _above(points: Array, solid: Solid) -> Array:
    """How far points (n, 3) are above the surface, relative to its radius; negative inside."""
    length = np.linalg.norm(points, axis=1)
    on_ellipsoid = np.linalg.norm(points / solid.radii_km, axis=1)
    height = solid.relief.height(points / length[:, None]) if solid.relief else 0.0
    return np.asarray(on_ellipsoid - 1 - height)


def _relief_crossing(
    start: Array, directions: Array, near: Array, far: Array, solid: Solid
) -> tuple[Array, NDArray[np.bool_]]:
    """Distances of the first crossing, and which rays have one: marching, then bisection."""
    outside, inside = near.copy(), far.copy()
    found = np.zeros(len(near), bool)
    for step in range(1, MARCH_STEPS + 1):
        open_ = np.flatnonzero(~found)
        if not len(open_):
            break
        at = near[open_] + (far - near)[open_] * step / MARCH_STEPS
        below = _above(start + at[:, None] * directions[open_], solid) <= 0
        inside[open_[below]] = at[below]
        found[open_[below]] = True
        outside[open_[~below]] = at[~below]
    rays = np.flatnonzero(found)
    for _ in range(BISECTIONS):
        middle = (outside[rays] + inside[rays]) / 2
        below = _above(start + middle[:, None] * directions[rays], solid) <= 0
        inside[rays[below]] = middle[below]
        outside[rays[~below]] = middle[~below]
    return inside, found


def _relief_normals(points: Array, solid: Solid) -> Array:
    """Outward normals (n, 3), by differences."""
    step = 1e-4 * float(solid.radii_km.mean())
    normals = np.stack(
        [_above(points + step * axis, solid) - _above(points - step * axis, solid) for axis in np.eye(3)], axis=1
    )
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def shaded(hits: Hits, rays: Array, solid: Solid, sun: Array, others: Sequence[Solid]) -> Array:
    """Radiance (n,) of points of `solid`; 0 where another solid stands before the Sun."""
    to_sun = solid.body_from_j2000 @ (sun / np.linalg.norm(sun))
    to_camera = -(rays @ solid.body_from_j2000.T)
    mu0, mu = hits.normals @ to_sun, (hits.normals * to_camera).sum(axis=1)
    phase = np.arccos(np.clip(to_camera @ to_sun, -1, 1))
    light = solid.brightness * radiance(solid.law, solid.parameters, mu0, mu, phase)
    if solid.texture is not None:
        light *= sample(solid.texture, hits.points_km @ solid.map_from_body.T)
    if others:
        in_j2000 = hits.points_km @ solid.body_from_j2000 + solid.centre_km
        for other in others:
            light[_in_shadow(in_j2000, other, sun)] = 0
    return light


def _in_shadow(points: Array, other: Solid, sun: Array) -> NDArray[np.bool_]:
    """Which points (n, 3), J2000 from the spacecraft, see the Sun behind `other`."""
    direction = other.body_from_j2000 @ (sun / np.linalg.norm(sun)) / other.radii_km
    from_other = (points - other.centre_km) @ other.body_from_j2000.T / other.radii_km
    along = from_other @ direction
    squared = (from_other**2).sum(axis=1) - 1
    return np.asarray((along < 0) & (along**2 - float(direction @ direction) * squared > 0))
