"""Where the other bodies of a scene are: beside the target, before or behind it, towards the Sun."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target

Array = NDArray[np.float64]
Placed = list[tuple[str, Array]]
MOONS = ("io", "europa", "ganymede")


def orientation_of(name: str) -> Array:
    """body_from_j2000 (3, 3) of the other bodies: poles some degrees off J2000's, longitudes as they come."""
    return rotation_from_vector_deg([0, 0, 37.0 * find_target(name).naif_id % 360]) @ rotation_from_vector_deg(
        [3.0, 2.0, 0.0]
    )


@dataclass(frozen=True)
class Frame:
    """Where a scene's target is; places of others follow."""

    target_km: Array
    sun: Array
    camera_from_j2000: Array
    focal_px: float
    radius_px: float
    radius_km: float
    random: np.random.Generator

    def seen_at(self, apart_px: float, angle_deg: float, along_km: float) -> Array:
        """Offset (3,) from the target of a body that is seen so far from it, and stands so much farther away."""
        range_km = float(np.linalg.norm(self.target_km))
        centre = self.camera_from_j2000 @ (self.target_km / range_km)
        place = centre / centre[2]
        across = apart_px / self.focal_px * np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg)), 0])
        ray = self.camera_from_j2000.T @ (place + across)
        ray /= np.linalg.norm(ray)
        return np.asarray((range_km + along_km) * ray - self.target_km)

    def px_of(self, name: str, along_km: float) -> float:
        """Largest radius of a body so much farther away, pixels."""
        range_km = float(np.linalg.norm(self.target_km)) + along_km
        return float(self.focal_px * max(find_target(name).radii_km) / range_km)

    @property
    def angle_deg(self) -> float:
        """A direction in the picture."""
        return float(self.random.uniform(0, 360))


def beside(frame: Frame, _: str) -> Placed:
    """Jupiter's limb 20 px from the moon's, Jupiter some 4e5 km behind."""
    along = float(frame.random.uniform(2e5, 6e5))
    apart = frame.radius_px + 20.0 + frame.px_of("jupiter", along)
    return [("jupiter", frame.seen_at(apart, frame.angle_deg, along))]


def transit(frame: Frame, _: str) -> Placed:
    """The moon wholly before Jupiter's disk."""
    along = float(frame.random.uniform(2e5, 6e5))
    inside = max(0.9 * frame.px_of("jupiter", along) - 1.5 * frame.radius_px, 0.0)
    return [("jupiter", frame.seen_at(float(frame.random.uniform(0, 0.8)) * inside, frame.angle_deg, along))]


def straddling(frame: Frame, _: str) -> Placed:
    """The moon before Jupiter's limb."""
    along = float(frame.random.uniform(2e5, 6e5))
    apart = frame.px_of("jupiter", along) + frame.radius_px * float(frame.random.uniform(-0.5, 0.5))
    return [("jupiter", frame.seen_at(apart, frame.angle_deg, along))]


def half_hidden(frame: Frame, target: str) -> Placed:
    """A nearer moon hides a part of the target."""
    other = str(frame.random.choice([name for name in MOONS if name != target]))
    along = -float(frame.random.uniform(0.1, 0.4)) * float(np.linalg.norm(frame.target_km))
    size = frame.px_of(other, along)
    apart = size + frame.radius_px * float(frame.random.uniform(-0.3, 0.5))
    return [(other, frame.seen_at(apart, frame.angle_deg, along))]


def hidden_by_planet(frame: Frame, _: str) -> Placed:
    """The moon comes out from behind Jupiter."""
    along = -float(frame.random.uniform(2e5, 0.3 * float(np.linalg.norm(frame.target_km))))
    apart = frame.px_of("jupiter", along) + frame.radius_px * float(frame.random.uniform(-0.3, 0.5))
    return [("jupiter", frame.seen_at(apart, frame.angle_deg, along))]


def across_sun(frame: Frame) -> Array:
    """A direction (3,) across the sunlight."""
    side = np.cross(frame.sun, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    return np.asarray(rotation_from_vector_deg(frame.angle_deg * frame.sun) @ side)


def shadow(frame: Frame, target: str) -> Placed:
    """Another moon's shadow on the target."""
    other = str(frame.random.choice([name for name in MOONS if name != target]))
    reach = 0.9 * find_target(other).mean_radius_km + frame.radius_km * float(frame.random.uniform(-0.2, 0.5))
    return [(other, float(frame.random.uniform(2e5, 6e5)) * frame.sun + reach * across_sun(frame))]


def moon_shadow(frame: Frame, _: str) -> Placed:
    """The shadow of a small moon on the target."""
    reach = frame.radius_km * float(frame.random.uniform(0.0, 0.6))
    return [("amalthea", float(frame.random.uniform(3e4, 8e4)) * frame.sun + reach * across_sun(frame))]


def eclipsed(frame: Frame, _: str) -> Placed:
    """Jupiter's shadow covers a part of the moon."""
    reach = 69_000.0 + frame.radius_km * float(frame.random.uniform(-0.4, 0.5))
    return [("jupiter", float(frame.random.uniform(4e5, 1e6)) * frame.sun + reach * across_sun(frame))]


def ring(frame: Frame, _: str) -> Placed:
    """The ansa of Saturn's rings before a part of the target, which is on the far side of its orbit."""
    pole, sight = orientation_of("saturn")[2], frame.target_km / np.linalg.norm(frame.target_km)
    outer = max(each.outer_km for each in find_target("saturn").rings)
    ansa = np.cross(sight, pole)
    ansa *= frame.random.choice([-1, 1]) / np.linalg.norm(ansa)
    gap = frame.radius_km * float(frame.random.uniform(-0.2, 0.7))
    behind = float(frame.random.uniform(1.2e5, 3e5))
    return [("saturn", -((outer + gap) * ansa + behind * sight))]


def night(frame: Frame, _: str) -> Placed:
    """Jupiter on the side of the spacecraft, outside the frame or beside the moon: it lights the night side."""
    sight = frame.target_km / np.linalg.norm(frame.target_km)
    side = np.cross(sight, [0.0, 0.0, 1.0])
    away = rotation_from_vector_deg(float(frame.random.uniform(15, 50)) * side / np.linalg.norm(side))
    around = rotation_from_vector_deg(frame.angle_deg * sight)
    return [("jupiter", -float(frame.random.uniform(4e5, 7e5)) * (around @ away @ sight))]


PLACES = {
    "beside": beside,
    "transit": transit,
    "straddling": straddling,
    "half-hidden": half_hidden,
    "hidden-by-planet": hidden_by_planet,
    "shadow": shadow,
    "eclipsed": eclipsed,
    "moon-shadow": moon_shadow,
    "ring": ring,
    "night": night,
}
