"""Where a sequence's target is, apart from its ephemeris and the spacecraft's trajectory: one offset, in km, of all
images of the sequence, by those whose camera's orientation is known by stars.

Image i sees the target's direction at d_i from the predicted place, in J2000 km across the line of sight, with the
errors of its stars and of the picture's noise, R_i, which are its own, and with those of map, photometric laws and
relief, P_i, which images of one sequence share, since all see the same side of the body in the same light. The offset
is the mean of the d_i weighted by (R_i + P_i)^-1; the shared errors do not become smaller by it. Along the line of
sight it is what the shared range factor says.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.pose import Pose
from tasks.adjust.measurement import Measurement
from tasks.adjust.solve import Adjustment
from tasks.joint.parameters import OFFSET, RANGE
from tasks.point.rotation import pose_pointed_at
from tasks.stars.separate import StarOrientation, orientation_covariance_px2

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sight:
    """One image with stars. place_px: (2,), of the target's centre less its predicted place, pixels of the stars'
    camera; own_px2, shared_px2: (2, 2), see the module. km: (2, 3), pixels by a displacement of the target (km, J2000).
    """

    position: int
    place_px: Array
    own_px2: Array
    shared_px2: Array
    km: Array


@dataclass(frozen=True)
class TargetOffset:
    """The offset of one sequence. offset_km: (3,) J2000; covariance_km2: (3, 3). chi_square, degrees: of the images
    with stars about it, by the errors that are their own. images: positions of those, residual_px: (n, 2) theirs."""

    offset_km: Array
    covariance_km2: Array
    chi_square: float
    degrees: int
    images: list[int]
    residual_px: Array


def target_offsets(
    images: Sequence[Measurement], poses: Sequence[Pose], adjustment: Adjustment
) -> list[TargetOffset | None]:
    """One per sequence; None for a sequence without stars. poses: the adjusted ones, before this."""
    found: list[TargetOffset | None] = []
    for number, positions in enumerate(adjustment.sequences):
        stars = [(i, images[i].stars) for i in positions]
        sights = [sight_of(i, images[i], each, poses[i]) for i, each in stars if each is not None]
        target_km = images[positions[0]].predicted.target_from_spacecraft_km
        along_km = target_km * np.expm1(adjustment.theta[adjustment.of_sequence(number).start])
        range_sigma = range_sigma_of([images[i] for i in positions], adjustment, number)
        found.append(solved(sights, target_km, along_km, range_sigma) if sights else None)
    return found


def range_sigma_of(images: Sequence[Measurement], adjustment: Adjustment, number: int) -> float:
    """1-sigma (relative) of a sequence's range; that of the trajectory where all images hold their range."""
    if all(image.held[RANGE] for image in images):
        return min(image.range_sigma for image in images)
    place = adjustment.of_sequence(number).start
    return float(np.sqrt(adjustment.covariance[place, place]))


def sight_of(position: int, image: Measurement, stars: StarOrientation, pose: Pose) -> Sight:
    """What an image with stars says of its target's place. pose: the adjusted one, with the stars' camera turned to
    where the target is seen."""
    camera, predicted = image.camera, image.predicted
    seen = camera.project(pose.target_in_camera_km)
    place = seen - camera.project(predicted.target_in_camera_km)
    stated, noise = image.covariance[OFFSET, OFFSET], image.noise[OFFSET, OFFSET]
    own = noise + orientation_covariance_px2(stars, pose.target_in_camera_km, camera)
    return Sight(position, place, own, stated - noise, pixels_by_km(predicted, camera))


def pixels_by_km(pose: Pose, camera: Camera) -> Array:
    """(2, 3): how the target's centre moves in the picture when it is displaced in J2000."""
    x, y, z = pose.target_in_camera_km
    slope = camera.focal_length_px / z * np.array([[1.0, 0.0, -x / z], [0.0, 1.0, -y / z]])
    return np.asarray(slope @ pose.camera_from_j2000)


def solved(sights: Sequence[Sight], target_km: Array, along_km: Array, range_sigma: float) -> TargetOffset:
    """The offset by images with stars. target_km: (3,) predicted place; along_km: (3,) the displacement along it that
    the shared range factor makes, of 1-sigma `range_sigma` (relative)."""
    distance = float(np.linalg.norm(target_km))
    along = target_km / distance
    across = _across(along)
    # Two coordinates across the line of sight, in km: the places are right to first order.
    to_plane = [np.linalg.inv(sight.km @ across.T) for sight in sights]
    places = [inverse @ sight.place_px for inverse, sight in zip(to_plane, sights, strict=True)]
    own = [inverse @ sight.own_px2 @ inverse.T for inverse, sight in zip(to_plane, sights, strict=True)]
    shared = [inverse @ _root(sight.shared_px2) for inverse, sight in zip(to_plane, sights, strict=True)]
    weights = [np.linalg.inv(o + s @ s.T) for o, s in zip(own, shared, strict=True)]
    total = np.linalg.inv(np.sum(weights, axis=0))
    gains = [total @ weight for weight in weights]
    mean = np.sum([gain @ each for gain, each in zip(gains, places, strict=True)], axis=0)
    # Shared errors are those of one surface: the gains' sum of their roots, and no mean of independent ones.
    common = np.sum([gain @ each for gain, each in zip(gains, shared, strict=True)], axis=0)
    spread = common @ common.T + np.sum([g @ each @ g.T for g, each in zip(gains, own, strict=True)], axis=0)
    residual = [each - mean for each in places]
    length = np.outer(along, along) * (distance * range_sigma) ** 2
    return TargetOffset(
        offset_km=np.asarray(across.T @ mean + along_km),
        covariance_km2=np.asarray(across.T @ spread @ across + length),
        chi_square=float(sum(r @ np.linalg.solve(o, r) for r, o in zip(residual, own, strict=True))),
        degrees=2 * len(sights) - 2,
        images=[sight.position for sight in sights],
        residual_px=np.array([sight.km @ across.T @ r for sight, r in zip(sights, residual, strict=True)]),
    )


def pose_with_target(image: Measurement, pose: Pose, offset: TargetOffset) -> Pose:
    """The adjusted pose with the target at the shared offset, and the camera as that and the picture say: turned until
    the target is where it is seen; with stars, by the stars' part of what is left between them and the picture. Pixels
    see what they saw. A body that the picture did not turn keeps its orientation in J2000."""
    camera, target_km = image.camera, image.predicted.target_from_spacecraft_km + offset.offset_km
    place = camera.project(pose.target_in_camera_km)
    begun = image.predicted.replaced(target_from_spacecraft_km=target_km)
    if image.stars is None:
        begun = pose.replaced(target_from_spacecraft_km=target_km)
    else:
        expected = camera.project(begun.target_in_camera_km)
        stars_px2 = orientation_covariance_px2(image.stars, pose.target_in_camera_km, camera)
        share = stars_px2 @ np.linalg.inv(stars_px2 + image.noise[OFFSET, OFFSET])
        place = expected + share @ (place - expected)
    found = pose_pointed_at(begun, camera, place)
    turn = found.camera_from_j2000.T @ pose.camera_from_j2000
    kept = np.array_equal(pose.body_from_j2000, image.predicted.body_from_j2000)
    return found.replaced(body_from_j2000=pose.body_from_j2000 if kept else pose.body_from_j2000 @ turn.T)


def camera_sigma_px(image: Measurement, offset: TargetOffset | None) -> Array:
    """1-sigma (2,) of where the camera looks, by the picture and the shared offset; NaN where neither tells the camera
    from the target."""
    if offset is None:
        return np.full(2, np.nan)
    by_target = pixels_by_km(image.predicted, image.camera) @ offset.covariance_km2
    by_target = by_target @ pixels_by_km(image.predicted, image.camera).T
    by_picture = by_target + image.covariance[OFFSET, OFFSET]
    if image.stars is None:
        return np.asarray(np.sqrt(np.diag(by_picture)))
    by_stars = orientation_covariance_px2(image.stars, image.predicted.target_in_camera_km, image.camera)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(np.linalg.inv(by_picture) + np.linalg.inv(by_stars)))))


def _across(along: Array) -> Array:
    """Two unit vectors (2, 3) across a unit vector (3,)."""
    axis = np.eye(3)[int(np.argmin(np.abs(along)))]
    first = np.cross(along, axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(along, first)])


def _root(covariance: Array) -> Array:
    """Symmetric root of a covariance (n, n); what is negative in it counts as none."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)
