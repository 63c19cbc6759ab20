"""How much of the Sun's disk other bodies and rings cover at points of a surface.

A ray from the point p towards the Sun, of direction s, passes the caster's centre d at the point nearest to it in the
coordinates in which the caster is the unit sphere (A = diag(1/r) R), Q. Rays to other points (x, y) of the Sun's disk,
in units of its angular radius, pass at Q + x U + y V there, U and V the disk's two axes at the caster's distance. So
along a chord of constant x the Sun is covered between the roots of |Q + x U + y V|^2 = 1, a quadratic in y: exact for
any ellipsoid, up to (Sun's radius / its distance)^2. The chords are summed.
"""

import numpy as np
from numpy.typing import NDArray

from tasks.bodies.placed import SUN_RADIUS_KM, Body

Array = NDArray[np.float64]

TINY = 1e-12
# Chords of the Sun's disk: fractions are right to 0.004 (tests/tasks/test_bodies.py).
CHORDS = 64


def covered_by_body(points_km: Array, receiver: Body, caster: Body) -> Array:
    """Fraction (n,) of the Sun's disk that `caster` covers at points (n, 3) of the receiver, its body-fixed km."""
    start, sun, to_sun = rays_to_sun(points_km, receiver, caster)
    a = 1.0 / np.asarray(caster.target.radii_km)
    scaled, direction = start * a, sun * a
    along = -(scaled * direction).sum(axis=1) / (direction**2).sum(axis=1)  # km towards the Sun
    nearest = scaled + along[:, None] * direction
    h, sun_km = np.linalg.norm(nearest, axis=1), SUN_RADIUS_KM / to_sun * along
    reach = sun_km * a.max()
    covered = np.where((along > 0) & (h + reach <= 1), 1.0, 0.0)
    partly = (along > 0) & (np.abs(h - 1) < reach)
    if partly.any():
        axes = across(sun[partly]) * sun_km[partly, None, None] * a
        unit = direction[partly] / np.linalg.norm(direction[partly], axis=1)[:, None]
        u, v = (axis - (axis * unit).sum(axis=1)[:, None] * unit for axis in np.swapaxes(axes, 0, 1))
        covered[partly] = covered_chords(nearest[partly], u, v)
    return covered


def across(direction: Array) -> Array:
    """Two unit vectors (n, 2, 3) at right angles to unit vectors (n, 3) and to each other."""
    least = np.eye(3)[np.argmin(np.abs(direction), axis=1)]
    first = np.cross(direction, least)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(direction, first)], axis=1)


def covered_chords(q: Array, u: Array, v: Array) -> Array:
    """Share (n,) of the unit disk of (x, y) in which |q + x u + y v| < 1; q, u, v: (n, 3)."""
    angles = (np.arange(CHORDS) + 0.5) * np.pi / CHORDS
    total, a = np.zeros(len(q)), np.maximum((v**2).sum(axis=1), TINY)
    for angle in angles:
        x, half = np.cos(angle), np.sin(angle)
        at = q + x * u
        b, c = (at * v).sum(axis=1), (at**2).sum(axis=1) - 1
        root = np.sqrt(np.maximum(b**2 - a * c, 0.0))
        low, high = np.maximum((-b - root) / a, -half), np.minimum((-b + root) / a, half)
        total += half * np.maximum(high - low, 0.0)
    return np.clip(total / CHORDS, 0.0, 1.0)


def covered_by_rings(points_km: Array, receiver: Body, caster: Body) -> Array:
    """Fraction (n,) of the sunlight that the caster's rings take away at points (n, 3) of the receiver. The Sun counts
    as a point: its disk is some hundred km wide at the rings."""
    start, sun, _ = rays_to_sun(points_km, receiver, caster)
    return 1.0 - np.exp(-slant_depth(start, sun, caster))


def rays_to_sun(points_km: Array, receiver: Body, caster: Body) -> tuple[Array, Array, Array]:
    """Points (n, 3) relative to the caster's centre and unit vectors (n, 3) to the Sun, in the caster's body-fixed
    frame, and the Sun's distances (n,), km."""
    pose = receiver.pose
    in_j2000 = points_km @ pose.body_from_j2000
    to_sun = pose.sun_from_target_km - in_j2000
    distance = np.linalg.norm(to_sun, axis=1)
    centre = np.zeros(3) if caster is receiver else caster.seen_from(receiver)
    turn = caster.pose.body_from_j2000.T
    return (in_j2000 - centre) @ turn, (to_sun / distance[:, None]) @ turn, distance


def slant_depth(start_km: Array, direction: Array, body: Body, farthest_km: Array | None = None) -> Array:
    """Optical depth (n,) of a body's rings along rays from `start_km` (n, 3) in `direction` (n, 3), unit vectors, both
    in its body-fixed frame, up to `farthest_km` (n,); 0 where a ray meets none."""
    cosine = direction[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = -start_km[:, 2] / cosine
    met = np.isfinite(along) & (along > 0)
    if farthest_km is not None:
        met &= ~(along >= farthest_km)
    depth = np.zeros(len(start_km))
    if not met.any():
        return depth
    crossing = start_km[met] + along[met, None] * direction[met]
    radius = np.hypot(crossing[:, 0], crossing[:, 1])
    normal = np.zeros(len(radius))
    for ring in body.target.rings:
        normal += np.where((radius >= ring.inner_km) & (radius < ring.outer_km), ring.optical_depth, 0.0)
    depth[met] = normal / np.maximum(np.abs(cosine[met]), TINY)
    return depth
