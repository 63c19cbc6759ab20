"""How the coordinates of a new map lie in the body: images and a map made of them may all be turned together without
any of them showing it. The turn is taken out by the old map, by the rotation model, or by what defines longitude."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError, WrongOptionError
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.robust import huber_weight, sigma_about_zero
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from catalog.target import Target
from tasks.control.matching import match_patches
from tasks.control.patches import Places, places_at, places_on
from tasks.control.settings import ControlSettings
from tasks.improve.map_patches import GroundMap, map_patches
from tasks.project.points import surface_points

Array = NDArray[np.float64]
FRAMES = ("map", "rotation", "feature")
FEWEST_PLACES = 6
ROUNDS = 10
NUMBER = r"([-+0-9.eE]+)"


@dataclass(frozen=True)
class Feature:
    """A feature whose longitude is defined: where it lies, and where the old map shows it; planetocentric latitude,
    east longitude, degrees."""

    name: str
    place_deg: tuple[float, float]
    on_old_map_deg: tuple[float, float]


def feature_of(text: str) -> Feature:
    """The feature of `NAME:LAT,LON`, or `NAME:LAT,LON@LAT,LON` where the old map shows it elsewhere. Raises
    WrongOptionError for anything else."""
    found = re.fullmatch(rf"([^:@]+):{NUMBER},{NUMBER}(?:@{NUMBER},{NUMBER})?", text.strip())
    try:
        numbers = [float(part) for part in (found.groups()[1:] if found else ()) if part is not None]
    except ValueError:
        numbers = []
    if not found or len(numbers) not in (2, 4) or any(abs(latitude) > 90 for latitude in numbers[::2]):
        raise WrongOptionError("feature", f"{text!r} is no feature.", "Give NAME:LAT,LON, for example Cilix:2.6,178.1.")
    return Feature(found[1], (numbers[0], numbers[1]), (numbers[-2], numbers[-1]))


@dataclass(frozen=True)
class MapTurn:
    """turn_deg (3,): rotation vector, body-fixed, that takes the old map's ground to where the new one shows it;
    sigma_deg: of each axis, by the scatter; scatter_deg: of single places along each direction, which is how far the
    maps' own places differ; places: how many were compared."""

    turn_deg: Array
    sigma_deg: float
    scatter_deg: float
    places: int


def displacements(
    new: GroundMap, old: GroundMap, places: Places, target: Target, settings: ControlSettings
) -> tuple[NDArray[np.intp], Array]:
    """Which places (k,) match, and how far (k, 2) km east and north the new map shows what the old one has there."""
    step = np.maximum(new.values(new.resolution_km, places.points), max(new.pixel_km, old.pixel_km))
    side, margin = settings.patch_px, settings.search_px
    first, known = map_patches(old, target, places, step, side)
    second, whole = map_patches(new, target, places, step, side + 2 * margin)
    both = np.flatnonzero(known & whole)
    if not len(both):
        return both, np.empty((0, 2))
    matches = match_patches(first[both], second[both], margin)
    good = matches.good & (matches.correlation >= settings.least_correlation)
    return both[good], matches.shift[good] * step[both[good], None] * np.array([1.0, -1.0])


def turn_between(new: GroundMap, old: GroundMap, target: Target, settings: ControlSettings) -> MapTurn:
    """The turn between two maps, by patches of both. Raises FailedError where too few match."""
    places = places_on(target, settings.points)
    which, moved = displacements(new, old, places, target, settings)
    if len(which) < FEWEST_PLACES:
        raise FailedError(
            Reason.NOTHING_TO_TIE, f"only {len(which)} places of the old and the new map match.",
            "Hold the frame by the rotation model (--hold-frame rotation).",
        )  # fmt: skip
    at = places.part(which)
    design = np.stack([np.cross(at.points, way) for way in (at.east, at.north)], axis=1)  # (turn x p) . way
    design = np.radians(design)
    turn, scale = np.zeros(3), 1.0
    inverse = np.eye(3)
    for _ in range(ROUNDS):
        residual = moved - design @ turn
        scale = max(sigma_about_zero(residual.ravel()), 1e-9)
        weight = huber_weight(np.abs(residual).max(axis=1) / scale, 2.0)
        inverse = np.linalg.inv(np.einsum("nki,nkj,n->ij", design, design, weight))
        turn = inverse @ np.einsum("nki,nk,n->i", design, moved, weight)
    degree_km = np.radians(1.0) * target.mean_radius_km
    return MapTurn(turn, float(scale * np.sqrt(np.trace(inverse) / 3)), float(scale / degree_km), len(which))


def turn_to_features(
    new: GroundMap, old: GroundMap, target: Target, features: Sequence[Feature], settings: ControlSettings
) -> float:
    """By how many degrees of longitude, in the mean, the new map shows the features east of where they lie. Raises
    FailedError for a feature that the two maps do not show alike."""
    off = []
    for feature in features:
        place = places_at(target, surface_points(target, *(np.array([angle]) for angle in feature.on_old_map_deg)))
        which, moved = displacements(new, old, place, target, settings)
        if not len(which):
            raise FailedError(
                Reason.NOTHING_TO_TIE, f"{feature.name} does not look the same on the old and the new map.",
                "Choose another feature, or hold the frame by the map (--hold-frame map).",
            )  # fmt: skip
        circle_km = target.mean_radius_km * np.cos(np.radians(feature.on_old_map_deg[0]))
        east = feature.on_old_map_deg[1] - feature.place_deg[1]
        off.append((east + 180) % 360 - 180 + float(np.degrees(moved[0, 0] / circle_km)))
    return float(np.mean(off))


def mean_turn_deg(poses: Sequence[Pose], before: Sequence[Pose]) -> Array:
    """The turn (3,), rotation vector, body-fixed, that best takes the bodies' orientations `before` to those of
    `poses`: of each only its part across the line of sight counts, for about it a turn of the body looks like
    one of the camera."""
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for pose, old in zip(poses, before, strict=True):
        turn = vector_deg_from_rotation(pose.body_from_j2000 @ old.body_from_j2000.T)
        sight = pose.spacecraft_in_body_km / pose.range_km
        across = np.eye(3) - np.outer(sight, sight)
        normal += across
        right += across @ turn
    return np.asarray(np.linalg.lstsq(normal, right, rcond=None)[0])


def turned_back(pose: Pose, turn_deg: Array) -> Pose:
    """The pose in whose coordinates ground lies where it was before it was turned by `turn_deg` (3,)."""
    return pose.replaced(body_from_j2000=rotation_from_vector_deg(-turn_deg) @ pose.body_from_j2000)
