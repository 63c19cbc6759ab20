"""Light that other bodies throw on the target's surface: planet-shine on the night side.

The other body is taken for a sphere that scatters as Lambert's surface does, of reflectance 3/2 of its geometric
albedo p. Its patches are summed as the target's centre sees them: a patch of the area dA and the distance D, at the
cosines mu0 and mu of sunlight and sight, gives (3/2) p mu0 mu dA / (pi D^2) of the sunlight that falls on it. From far
away that is the known

    E = p phi(a) (R / d)^2,  phi(a) = (sin a + (pi - a) cos a) / pi

with radius R, distance d and phase angle a (Russell 1916, Astrophys. J. 43, 173; Sobolev 1975, Light Scattering in
Planetary Atmospheres), and the light seems to come from (3 pi / 16) R sin a (1 + cos a) / (sin a + (pi - a) cos a)
beside the disk's centre (Lindegren 1977, A&A 57, 55). At Io, six radii from Jupiter, the formula is 11 % too low at
full phase.

A near planet is wide in the sky, so its dusk is: a disk of the angular radius r, whose middle stands at the angle whose
cosine is c over the ground, lights it as much as its part above the horizon.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.placed_body import PlacedBody
from catalog.pose import Pose
from catalog.target import Target
from tasks.compiled import compiled_reordered
from tasks.geometry.unit_sphere import closest_approach
from tasks.simulate.others import OtherBodiesSettings
from tasks.simulate.photometry import Law
from tasks.simulate.window import Window

Array = NDArray[np.float64]
Image = NDArray[np.float32]


@dataclass(frozen=True)
class Shine:
    """Light of one other body at the target. direction: unit vector (3,) to where it comes from, body-fixed. share: of
    the sunlight at the target, on ground that it falls on straight. sine_radius: sine of the angular radius of the disk
    that it comes from. phase_deg: angle at the target between it and the spacecraft."""

    direction: Array
    share: float
    sine_radius: float
    phase_deg: float


def shine_of(place: PlacedBody, pose: Pose, target: Target) -> Shine:
    """The light of another body at the target of `pose`."""
    away = np.array(place.seen_from_km.get(target.naif_id, place.from_target_km))
    sun, to_sun = np.array(place.sun_from_body_km), pose.sun_from_target_km
    radius = float(np.cbrt(np.prod(place.radii_km)))
    distance = max(float(np.linalg.norm(away)), radius)
    normals = patches()
    to_target = -(away + radius * normals)
    square = (to_target**2).sum(axis=1)
    lit = np.maximum(normals @ sun, 0) / np.linalg.norm(sun)
    seen = np.maximum((normals * to_target).sum(axis=1), 0) / np.sqrt(square)
    power = 1.5 * place.geometric_albedo * lit * seen * 4 * radius**2 / len(normals) / square
    light = -((power / np.sqrt(square)) @ to_target) * float((to_sun @ to_sun) / (sun @ sun))
    share = float(np.linalg.norm(light))
    direction = pose.body_from_j2000 @ (light / share if share > 0 else away / distance)
    to_spacecraft = pose.spacecraft_in_body_km / pose.range_km
    angle = float(np.degrees(np.arccos(np.clip(direction @ to_spacecraft, -1, 1))))
    # The light of a crescent comes from a narrow part of the disk.
    wide = (1 - float(away @ sun) / (distance * float(np.linalg.norm(sun)))) / 2
    return Shine(direction, share, radius / distance * math.sqrt(min(max(wide, 0.0), 1.0)), angle)


@cache
def patches(count: int = 2000) -> Array:
    """Unit vectors (count, 3) to patches of a sphere of equal areas (a sunflower)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    out = np.sqrt(1 - z**2)
    return np.stack([out * np.cos(angle), out * np.sin(angle), z], axis=1)


def shines_of(pose: Pose, target: Target, settings: OtherBodiesSettings) -> list[Shine]:
    """The light of other bodies of a pose that counts, see `counts`; none of a frame of one body."""
    every = (shine_of(place, pose, target) for place in pose.bodies)
    return [shine for shine in every if counts(shine, pose, settings)]


def counts(shine: Shine, pose: Pose, settings: OtherBodiesSettings) -> bool:
    """Whether a light is strong enough, and so much of the night side in sight that it is seen."""
    night = (1 - math.cos(math.radians(pose.phase_deg))) / 2
    return shine.share >= settings.least_shine and night >= settings.least_night


def with_shines(law: Law, mu0: Image, mu: Image, phase_deg: float, shines: list[Shine], cosines: list[Image]) -> Image:
    """Brightness by a photometric law under the Sun and other lights. cosines: for each of `shines`, see `cosines_of`;
    the law's change with phase angle is what it says, that of the surface's albedo is unknown and left out."""
    light = law(mu0, mu, phase_deg)
    for shine, cosine in zip(shines, cosines, strict=True):
        light = light + np.float32(shine.share) * law(cosine, mu, shine.phase_deg)
    return light


def cosines_of(
    shines: list[Shine], pose: Pose, camera: Camera, target: Target, window: Window, oversample: int
) -> list[Image]:
    """For each light what the ground gets of it, the cosine of incidence where all of its disk is up, (ny*s, nx*s) at
    an s x s grid of sub-pixels of `window`; on rays that miss the target of the limb beside them."""
    rows, columns = (n * oversample for n in window.shape)
    radii, half = np.asarray(target.radii_km, np.float64), 0.5 - 0.5 / oversample
    first = np.array([window.x0 - half - camera.centre_px[0], window.y0 - half - camera.centre_px[1]])
    outs = []
    for shine in shines:
        outs.append(np.zeros((rows, columns), np.float32))
        _fill(
            first / camera.focal_length_px, 1 / (oversample * camera.focal_length_px),
            pose.camera_from_body.T / radii[:, None], pose.spacecraft_in_body_km / radii, radii, shine.direction,
            shine.sine_radius, outs[-1],
        )  # fmt: skip
    return outs


@compiled_reordered
def _fill(first, step, to_scaled, spacecraft, radii, light, sine_radius, out):  # type: ignore[no-untyped-def]
    """In the body frame whose axes are scaled so that the target is the unit sphere, as in `closed_form`."""
    rows, columns = out.shape
    ox, oy, oz = spacecraft[0], spacecraft[1], spacecraft[2]
    for i in range(rows):
        v = first[1] + i * step
        for j in range(columns):
            u = first[0] + j * step
            dx = to_scaled[0, 0] * u + to_scaled[0, 1] * v + to_scaled[0, 2]
            dy = to_scaled[1, 0] * u + to_scaled[1, 1] * v + to_scaled[1, 2]
            dz = to_scaled[2, 0] * u + to_scaled[2, 1] * v + to_scaled[2, 2]
            cx, cy, cz, half_chord2, length2 = closest_approach(ox, oy, oz, dx, dy, dz)
            t = math.sqrt(max(half_chord2, 0.0) / length2)
            nx, ny, nz = (cx - t * dx) / radii[0], (cy - t * dy) / radii[1], (cz - t * dz) / radii[2]
            cosine = (nx * light[0] + ny * light[1] + nz * light[2]) / math.sqrt(nx * nx + ny * ny + nz * nz)
            if cosine >= sine_radius:
                out[i, j] = cosine
            elif cosine > -sine_radius:
                up = cosine / sine_radius
                below = math.sqrt(1.0 - up * up)
                out[i, j] = (
                    cosine * (0.5 + (math.asin(up) + up * below) / math.pi)
                    + (2.0 * sine_radius / (3.0 * math.pi)) * below * below * below
                )
