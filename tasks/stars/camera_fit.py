"""A camera's focal length and radial distortion by the stars of several of its frames, with their orientations.

A star at the tangent-plane place u of the camera's frame is measured at

    p = c + (q - c) (1 + k |q - c|^2 / R^2),   q = c + f (1 + a) u,

pixels, with the camera's centre c, focal length f and half diagonal R. Unknown are a and k, the same in all frames, and
three angles of each frame; k R is what distortion the camera's own model leaves in the corner. Least squares with
Huber's weights and one error common to all stars, as the orientation of one frame (`fit_orientation`)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.camera_constants import SOLVABLE, corner_of
from catalog.robust import huber_weight
from catalog.rotation import rotation_from_vector_deg
from tasks.stars.match import Measured, match_stars
from tasks.stars.orientation import HUBER, LEAST_SIGMA_PX, extra_sigma, projected

Array = NDArray[np.float64]
ROUNDS, STEPS = 8, 20
STILL_PX, RESTED_PX = 1e-5, 1e-3  # changes at which the iterations end: of a fit, and between identifications
SPARE = 6  # measured coordinates beyond the unknowns, at least


@dataclass(frozen=True)
class StarFrame:
    """One frame. directions (n, 3), magnitude (n,): of all catalog stars about it, apparent; seen: all detections that
    stand out; detection, star: (m,) those that belong together. camera_from_j2000: (3, 3) by them."""

    name: str
    directions: Array
    magnitude: Array
    seen: Measured
    detection: NDArray[np.int_]
    star: NDArray[np.int_]
    camera_from_j2000: Array


@dataclass(frozen=True)
class CameraFit:
    """frames: as given, with the stars and orientations found at last. parameters (2,): a and k, zero for what was not
    solved; covariance (2, 2). rms_px: before, with the camera as it is known, and after. extra_sigma_px: error of one
    coordinate beyond the stated ones. stars: how many were used."""

    camera: Camera
    frames: list[StarFrame]
    parameters: Array
    covariance: Array
    rms_px: tuple[float, float]
    extra_sigma_px: float
    stars: int

    @property
    def corner_px(self) -> float:
        """Half diagonal R of the frame."""
        return corner_of(self.camera)


def fit_camera(
    camera: Camera, frames: Sequence[StarFrame], solve: Sequence[str], radius_px: float, least: int
) -> CameraFit | None:
    """The camera that all frames ask for; None where their stars are too few for its unknowns. solve: of SOLVABLE.
    radius_px: within which a star is looked for at first; least: fewest stars of a frame. Stars are identified anew
    with each camera found: one whose scale is off loses those of the corners."""
    free = np.array([name in solve for name in SOLVABLE])
    parameters = np.zeros(2)
    begun = _fitted(camera, frames, parameters, np.zeros(2, bool))
    for _ in range(ROUNDS):
        if 2 * sum(len(each.star) for each in frames) < 3 * len(frames) + free.sum() + SPARE:
            return None
        fit = _fitted(camera, frames, parameters, free)
        moved = np.abs(fit.parameters - parameters) * corner_of(camera)
        parameters = fit.parameters
        again = [_matched(camera, each, parameters, radius_px, least) for each in fit.frames]
        same = all(np.array_equal(a.star, b.star) for a, b in zip(again, frames, strict=True))
        frames = again
        if same and moved.max() < RESTED_PX:
            break
    return replace(fit, rms_px=(begun.rms_px[1], fit.rms_px[1]))


def corrected(camera: Camera, parameters: Array, xy_px: Array) -> Array:
    """Where the camera of the catalog would have measured (n, 2) what a camera of these parameters did."""
    scale, bent = parameters
    centre = np.asarray(camera.centre_px)
    away = xy_px - centre
    straight = away.copy()
    for _ in range(STEPS):
        straight = away / (1 + bent * (straight**2).sum(axis=-1, keepdims=True) / corner_of(camera) ** 2)
    return np.asarray(centre + straight / (1 + scale))


def _matched(camera: Camera, frame: StarFrame, parameters: Array, radius_px: float, least: int) -> StarFrame:
    """The frame with its stars identified anew; as it is where that leads to fewer."""
    seen = replace(frame.seen, xy_px=corrected(camera, parameters, frame.seen.xy_px))
    found = match_stars(camera, frame.camera_from_j2000, frame.directions, frame.magnitude, seen, radius_px, least)
    if found is None or len(found.star) < len(frame.star):
        return frame
    return replace(
        frame, detection=found.detection, star=found.star, camera_from_j2000=found.orientation.camera_from_j2000
    )


def _fitted(camera: Camera, frames: Sequence[StarFrame], start: Array, free: NDArray[np.bool_]) -> CameraFit:
    """Gauss-Newton for the parameters that are free and all orientations, with the stars as they are identified."""
    parameters, turned = np.where(free, start, 0.0), [each.camera_from_j2000 for each in frames]
    stated = np.concatenate([np.maximum(each.seen.sigma_px[each.detection], LEAST_SIGMA_PX) for each in frames])
    measured = np.concatenate([each.seen.xy_px[each.detection] for each in frames])
    owner = np.repeat(np.arange(len(frames)), [len(each.star) for each in frames])
    for _ in range(STEPS):
        places, by_angles, by_camera = _computed(camera, frames, turned, parameters)
        residual = measured - places
        extra = extra_sigma(residual, stated, 3 * len(frames) + int(free.sum()))
        sigma = np.hypot(stated, extra)
        weight = huber_weight(np.linalg.norm(residual, axis=1) / sigma, HUBER) / sigma**2
        columns = np.zeros((len(owner), 2, 3 * len(frames) + 2))
        for axis in range(3):
            columns[np.arange(len(owner)), :, 3 * owner + axis] = by_angles[:, :, axis]
        columns[:, :, -2:] = np.where(free, by_camera, 0.0)
        kept = np.append(np.ones(3 * len(frames), bool), free)
        design = columns[:, :, kept]
        normal = np.einsum("nki,n,nkj->ij", design, weight, design)
        change = np.zeros(len(kept))
        change[kept] = np.linalg.solve(normal, np.einsum("nki,n,nk->i", design, weight, residual))
        parameters = parameters + change[-2:]
        angles = np.degrees(change[:-2]).reshape(-1, 3)
        turned = [rotation_from_vector_deg(angle) @ each for angle, each in zip(angles, turned, strict=True)]
        if np.abs(design @ change[kept]).max() < STILL_PX:
            break
    covariance = np.zeros((len(kept), len(kept)))
    covariance[np.ix_(kept, kept)] = np.linalg.inv(normal)
    rms = float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))
    after = [replace(each, camera_from_j2000=t) for each, t in zip(frames, turned, strict=True)]
    return CameraFit(camera, after, parameters, covariance[-2:, -2:], (rms, rms), extra, len(owner))


def _computed(
    camera: Camera, frames: Sequence[StarFrame], turned: Sequence[Array], parameters: Array
) -> tuple[Array, Array, Array]:
    """Places (n, 2) of the stars of all frames, their derivatives (n, 2, 3) by a small rotation (radians) of their own
    frame's camera, and (n, 2, 2) by the parameters."""
    scale, bent = parameters
    parts = [projected(camera, t, each.directions[each.star]) for each, t in zip(frames, turned, strict=True)]
    centre, corner = np.asarray(camera.centre_px), corner_of(camera)
    straight = (1 + scale) * (np.concatenate([places for places, _ in parts]) - centre)
    slopes = (1 + scale) * np.concatenate([slope for _, slope in parts])
    squared = (straight**2).sum(axis=1) / corner**2
    stretched = (1 + bent * squared)[:, None, None] * np.eye(2)
    stretched = stretched + 2 * bent / corner**2 * np.einsum("ni,nj->nij", straight, straight)
    by_scale = np.einsum("nij,nj->ni", stretched, straight / (1 + scale))
    by_bend = straight * squared[:, None]
    places = centre + straight * (1 + bent * squared)[:, None]
    return places, stretched @ slopes, np.stack([by_scale, by_bend], axis=-1)
