"""All bodies of a pose, the target among them: each with a pose of its own, and which of them matter to an image."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.placed_body import PlacedBody
from catalog.pose import Pose
from catalog.target import Target
from tasks.simulate.others import OtherBodiesSettings
from tasks.simulate.shine import counts, shine_of

Array = NDArray[np.float64]

SUN_RADIUS_KM = 695_700.0  # IAU 2015 resolution B3
DEFAULTS = OtherBodiesSettings()


@dataclass(frozen=True, eq=False)
class Body:
    """One body as an image sees it. pose: with this body as its target; target: its shape. place: None for the image's
    own target."""

    pose: Pose
    target: Target
    place: PlacedBody | None = None

    @property
    def naif_id(self) -> int:
        """Its NAIF id."""
        return self.target.naif_id

    @property
    def reach_km(self) -> float:
        """Radius of a sphere that holds the body and its rings."""
        return max(*self.target.radii_km, *(ring.outer_km for ring in self.target.rings))

    def radius_px(self, camera: Camera) -> float:
        """Radius of the disk, pixels."""
        return float(camera.focal_length_px * max(self.target.radii_km) / self.pose.range_km)

    def seen_from(self, other: "Body") -> Array:
        """This body's centre (3,) as the other one sees it, km, J2000."""
        if self.place is not None and other.naif_id in self.place.seen_from_km:
            return np.array(self.place.seen_from_km[other.naif_id])
        if self.place is None and other.place is not None and self.naif_id in other.place.seen_from_km:
            # Where they are when the light leaves them differs by what they move in the light time between them.
            return -np.array(other.place.seen_from_km[self.naif_id])
        return self.pose.target_from_spacecraft_km - other.pose.target_from_spacecraft_km


def pose_of(place: PlacedBody, pose: Pose) -> Pose:
    """`pose` with another body as its target; velocities only where both are known."""
    known = place.velocity_km_s is not None and pose.spacecraft_velocity_km_s is not None
    return pose.replaced(
        target_from_spacecraft_km=pose.target_from_spacecraft_km + place.offset_km,
        sun_from_target_km=np.array(place.sun_from_body_km),
        body_from_j2000=place.rotation,
        spacecraft_velocity_km_s=pose.spacecraft_velocity_km_s if known else None,
        target_velocity_km_s=np.array(place.velocity_km_s) if known else None,
        bodies=(),
    )


def bodies_of(pose: Pose, target: Target) -> list[Body]:
    """The target and the other bodies of its pose, the nearest first."""
    others = [Body(pose_of(place, pose), place.as_target, place) for place in pose.bodies]
    return sorted([Body(pose, target), *others], key=lambda body: body.pose.range_km)


def in_frame(body: Body, camera: Camera, margin_px: float = 0.0) -> bool:
    """Whether a part of the body's disk or rings may be in the frame, or within `margin_px` of it."""
    centre = body.pose.target_in_camera_km
    if body.pose.range_km <= body.reach_km:
        return True
    if centre[2] <= 0:
        return False
    reach = camera.focal_length_px * body.reach_km / centre[2] + margin_px
    x, y = camera.project(centre)
    nx, ny = camera.size_px
    away = np.hypot(max(-0.5 - x, x - nx + 0.5, 0.0), max(-0.5 - y, y - ny + 0.5, 0.0))
    return bool(away <= reach)


def may_shadow(caster: Body, receiver: Body) -> bool:
    """Whether the caster's shadow, penumbra and rings included, may fall on the receiver."""
    away, sun = caster.seen_from(receiver), receiver.pose.sun_from_target_km
    distance, to_sun = float(np.linalg.norm(away)), float(np.linalg.norm(sun))
    if caster is receiver or not 0 < distance < to_sun:
        return False
    apart = float(np.arctan2(np.linalg.norm(np.cross(away, sun)), away @ sun))
    reach = (caster.reach_km + receiver.reach_km) / distance
    return apart <= (np.pi if reach >= 1 else np.arcsin(reach)) + np.arcsin(SUN_RADIUS_KM / to_sun)


def relevant(
    pose: Pose,
    camera: Camera,
    target: Target,
    candidates: Iterable[PlacedBody],
    settings: OtherBodiesSettings = DEFAULTS,
) -> list[PlacedBody]:
    """Those of the candidates that may be in the frame, a pointing error allowed for, may shadow what is, or light the
    target's night side."""
    own = Body(pose, target)
    every = [Body(pose_of(place, pose), place.as_target, place) for place in candidates]
    large = [body for body in every if body.radius_px(camera) >= settings.least_radius_px]
    margin_px = settings.beside_frame * max(camera.size_px)
    shown = [body for body in large if in_frame(body, camera, margin_px)]
    receivers = [own, *shown]
    chosen = [body for body in large if body in shown or any(may_shadow(body, receiver) for receiver in receivers)]
    places = [body.place for body in every if body.place is not None]
    lights = [place for place in places if counts(shine_of(place, pose, target), pose, settings)]
    chosen_places = [body.place for body in chosen]
    return [place for place in places if any(place is each for each in (*chosen_places, *lights))]
