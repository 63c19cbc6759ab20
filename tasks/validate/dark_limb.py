"""Light outside the model's limb where that is in shadow: a dark side lit by a planet, or by nothing, ends where the
body ends."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.robust import MAD_TO_SIGMA
from tasks.compare.match import framed_window
from tasks.project.curves import limb
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]

# Sectors of the limb; the reach of a profile to each side, and the length of the steps that are looked for, px.
SECTORS, REACH_PX, STEP_PX = 24, 14, 4
# A limb is dark where the Sun stands so far below the horizon; its edge is seen where the step has so many sigmas.
DARK_DEG, SEEN_SIGMAS = 97.0, 8.0
# Edges outside the limb by more than so many pixels, in so many of the dark sectors whose edges are seen, are a fault.
OUTSIDE_PX, FEWEST_SECTORS, SHARE = 1.2, 3, 0.5
SMALLEST_RADIUS_PX = 12.0
FEWEST_IN_BIN = 3


@dataclass(frozen=True)
class DarkLimb:
    """dark: sectors of the limb that are dark and in the frame; seen: in how many of them an edge is seen; outside_px:
    median distance of those edges from the model's limb, outward, None where none is seen; outside: how many of them
    are outside the limb by more than OUTSIDE_PX."""

    dark: int
    seen: int
    outside: int
    outside_px: float | None

    @property
    def is_fault(self) -> bool:
        """Whether the body is seen to reach beyond the model's limb."""
        return self.outside >= FEWEST_SECTORS and self.outside >= SHARE * self.dark

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"dark": self.dark, "seen": self.seen, "outside": self.outside, "outside_px": self.outside_px}


NOT_SEEN = DarkLimb(0, 0, 0, None)


def dark_limb(observation: Observation, pose: Pose, scene: Scene) -> DarkLimb:
    """Where the image has edges near the dark part of the limb of `pose`, sector by sector."""
    radius = disk_radius_px(pose, scene.camera, scene.target)
    if radius < SMALLEST_RADIUS_PX:
        return NOT_SEEN
    window = framed_window(scene, pose, margin_px=REACH_PX + 2.0)
    image, noise = (window.crop(a).astype(np.float64) for a in (observation.image, observation.noise))
    usable = window.crop(observation.usable, fill=False)
    y, x = np.mgrid[window.y0 : window.y1, window.x0 : window.x1]
    curve = limb(pose, scene.camera, scene.target)
    centre = scene.camera.project(pose.target_in_camera_km)
    away = curve.xy_px - centre
    direction = np.arctan2(away[:, 1], away[:, 0])
    order = np.argsort(direction)
    normals = curve.points_km / np.square(scene.target.radii_km)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    down = normals @ pose.sun_direction_in_body
    angle = np.arctan2(y - centre[1], x - centre[0])
    edge = np.interp(angle, direction[order], np.linalg.norm(away, axis=1)[order], period=2 * np.pi)
    sun = np.interp(angle, direction[order], down[order], period=2 * np.pi)
    outward = np.hypot(x - centre[0], y - centre[1]) - edge
    near = usable & (np.abs(outward) < REACH_PX + 0.5) & (sun < np.cos(np.radians(DARK_DEG)))
    sector = ((angle + np.pi) / (2 * np.pi) * SECTORS).astype(np.int64) % SECTORS
    places, dark = [], 0
    for number in range(SECTORS):
        here = near & (sector == number)
        profile = radial_profile(outward[here], image[here], noise[here])
        if profile is None:
            continue
        dark += 1
        place = edge_in(*profile)
        if place is not None:
            places.append(place)
    outside = sum(place > OUTSIDE_PX for place in places)
    return DarkLimb(dark, len(places), outside, float(np.median(places)) if places else None)


def radial_profile(outward: Array, values: Array, noise: Array) -> tuple[Array, Array] | None:
    """Median (2 REACH_PX + 1,) of the values in rings one pixel wide and its error; None where a ring is empty."""
    ring = np.rint(outward).astype(np.int64) + REACH_PX
    counts = np.bincount(ring, minlength=2 * REACH_PX + 1)
    if counts.min() < FEWEST_IN_BIN:
        return None
    middle = medians(values, ring, counts)
    scatter = MAD_TO_SIGMA * medians(np.abs(values - middle[ring]), ring, counts)
    error = 1.25 * np.maximum(scatter, medians(noise, ring, counts)) / np.sqrt(counts)
    return middle, error


def medians(values: Array, label: NDArray[np.int64], counts: NDArray[np.int64]) -> Array:
    """Medians (k,) of the values (n,) of each label 0 to k - 1, of which there are counts (k,), none of them zero."""
    ordered = values[np.lexsort((values, label))]
    first = np.cumsum(counts) - counts
    return np.asarray((ordered[first + (counts - 1) // 2] + ordered[first + counts // 2]) / 2, np.float64)


def edge_in(profile: Array, error: Array) -> float | None:
    """Where, px outward of the model's limb, the profile falls by its clearest step; None where none is clear.

    A slope that goes on to both sides of the step, as of scattered light, is no part of it.
    """
    best, place, count = 0.0, None, len(profile)
    for k in range(STEP_PX + 1, count - STEP_PX):
        inner, outer = slice(k - STEP_PX, k), slice(k, k + STEP_PX)
        # Steps of each side: what falls within it would have fallen without an edge, too.
        within = max(profile[inner][0] - profile[inner][-1], profile[outer][0] - profile[outer][-1], 0.0)
        fall = float(np.mean(profile[inner]) - np.mean(profile[outer])) - within * STEP_PX / (STEP_PX - 1)
        sigma = float(np.sqrt((error[inner] ** 2).sum() + (error[outer] ** 2).sum())) / STEP_PX
        if fall > SEEN_SIGMAS * sigma and fall / sigma > best:
            best, place = fall / sigma, k - 0.5 - REACH_PX
    return place


def doubt_of_dark_limb(found: DarkLimb) -> str | None:
    """The doubt, as `code: fault. Remedy.`"""
    if not found.is_fault:
        return None
    return (
        f"{Reason.LIGHT_OUTSIDE_THE_LIMB}: {found.outside} of {found.dark} sectors of the dark limb have their edge "
        f"{found.outside_px:.1f} px (median) outside the model's. Check range, Sun direction, orientation and target."
    )
