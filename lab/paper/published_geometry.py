"""The paper's published poses of 57 images of Europa against pure SPICE geometry, and against each other."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.camera import find_camera
from catalog.pose import PartialPose
from catalog.robust import sigma_about_zero
from catalog.rotation import vector_deg_from_rotation
from catalog.spice import kernel_pool
from catalog.spice_pose import LIGHT_KM_PER_S, pose_parts_from_loaded
from catalog.target import Target, find_target
from lab.simulate.europa57 import PaperImage

Array = NDArray[np.float64]
# Images taken closer together than this see the same kernel errors: what differs is the correction's own error.
NEIGHBOURS_S = 300.0
# A smaller turn is the kernels' own (another version of the rotation model): the paper left the attitude alone.
UNTOUCHED_DEG = 0.03
EUROPA_DAY_S = 3.551181 * 86400


@dataclass(frozen=True)
class PublishedDifference:
    """A published pose minus what the kernels say; what they do not cover is None, and `missing` says so in words.

    range_factor: published over SPICE range, its kdist included. range_factor_before: without. direction_px: (dx, dy)
    of the target's centre, published minus SPICE, at the camera's focal length. turn_deg: (3,) turn of the body from
    SPICE's attitude to the published one, in the camera's axes: about x (surface moves along the lines), about y, and
    about the boresight (roll). pointing_px: (dx, dy) by which the published camera moved the target, where a C-kernel
    knows the camera; camera_roll_deg: how far it was rolled.
    """

    image: PaperImage
    radius_px: float
    range_factor: float | None
    range_factor_before: float | None
    direction_px: tuple[float, float] | None
    turn_deg: Array | None
    pointing_px: tuple[float, float] | None
    camera_roll_deg: float | None
    missing: tuple[str, ...]

    @property
    def turn_angle_deg(self) -> float | None:
        """Size of the turn."""
        return None if self.turn_deg is None else float(np.linalg.norm(self.turn_deg))

    @property
    def turned(self) -> bool:
        """Whether the paper corrected the attitude at all."""
        return (self.turn_angle_deg or 0.0) > UNTOUCHED_DEG

    @property
    def turn_in_body_deg(self) -> Array | None:
        """The turn (3,) about the body's own axes; the last is the pole, about which markings move east."""
        return None if self.turn_deg is None else self.image.pose.camera_from_body.T @ self.turn_deg

    @property
    def sub_spacecraft_deg(self) -> tuple[float, float]:
        """Planetocentric latitude and east longitude (0-360) of the middle of the disk."""
        x, y, z = self.image.pose.spacecraft_in_body_km
        return float(np.degrees(np.arctan2(z, np.hypot(x, y)))), float(np.degrees(np.arctan2(y, x)) % 360)

    @property
    def sun_in_east(self) -> bool:
        """Whether the Sun stands east of the middle of the disk: what shading pulls, it pulls the other way in the
        west."""
        x, y, _ = self.image.pose.spacecraft_in_body_km
        return bool(self.image.pose.sun_direction_in_body @ (-y, x, 0.0) > 0)

    @property
    def turned_while_light_travelled_deg(self) -> float:
        """How far Europa rotates in the light time: what an attitude taken at the time of exposure is off by."""
        return 360.0 / EUROPA_DAY_S * self.image.pose.range_km / LIGHT_KM_PER_S

    @property
    def turn_px(self) -> float | None:
        """How far the turn moves the middle of the disk: what of it shows, roll apart."""
        if self.turn_deg is None:
            return None
        return float(np.radians(np.hypot(*self.turn_deg[:2])) * self.radius_px)


def published_differences(images: Iterable[PaperImage], kernels: Sequence[Path]) -> list[PublishedDifference]:
    """Every image against the kernels (files or folders). Raises RefusedError for a kernel that cannot be loaded."""
    europa = find_target("europa")
    with kernel_pool(kernels) as loaded:
        found = []
        for image in images:
            spice = pose_parts_from_loaded(find_camera(image.camera), europa, image.pose.et, loaded)
            found.append(_difference(image, spice.parts, spice.missing, europa))
    return found


def _difference(image: PaperImage, spice: PartialPose, missing: tuple[str, ...], target: Target) -> PublishedDifference:
    camera, pose = find_camera(image.camera), image.pose
    there = spice.target_from_spacecraft_km
    factor = direction = pointing = roll = turn = None
    if there is not None:
        factor = pose.range_km / float(np.linalg.norm(there))
        ours = camera.project(pose.camera_from_j2000 @ there)
        direction = _xy(camera.project(pose.target_in_camera_km) - ours)
    if spice.body_from_j2000 is not None:
        turned = pose.body_from_j2000.T @ spice.body_from_j2000
        in_camera = pose.camera_from_j2000 @ turned @ pose.camera_from_j2000.T
        turn = vector_deg_from_rotation(in_camera)
    if spice.camera_from_j2000 is not None and there is not None:
        before = camera.project(spice.camera_from_j2000 @ there)
        pointing = _xy(camera.project(pose.target_in_camera_km) - before)
        roll = float(vector_deg_from_rotation(pose.camera_from_j2000 @ spice.camera_from_j2000.T)[2])
    return PublishedDifference(
        image=image,
        radius_px=camera.focal_length_px * target.mean_radius_km / pose.range_km,
        range_factor=factor,
        range_factor_before=None if factor is None else factor / image.range_factor,
        direction_px=direction,
        turn_deg=turn,
        pointing_px=pointing,
        camera_roll_deg=roll,
        missing=missing,
    )


def _xy(pair: Array) -> tuple[float, float]:
    return float(pair[0]), float(pair[1])


@dataclass(frozen=True)
class Neighbours:
    """Two images of one camera taken `seconds` apart. turn_deg: (3,) by which their body turns disagree, in the first
    one's camera axes. range_factor: difference of their range factors. radius_px: of the disk."""

    first: PublishedDifference
    second: PublishedDifference
    seconds: float
    turn_deg: Array
    range_factor: float

    @property
    def angle_deg(self) -> float:
        """Size of the disagreement."""
        return float(np.linalg.norm(self.turn_deg))

    @property
    def turned(self) -> bool:
        """Whether the attitude of one of them was corrected: two that were left alone agree by construction."""
        return self.first.turned or self.second.turned

    @property
    def surface_px(self) -> float:
        """By how many pixels the two would put a place in the middle of the disk apart."""
        return float(np.radians(np.hypot(*self.turn_deg[:2])) * self.first.radius_px)


def neighbours(found: Sequence[PublishedDifference], within_s: float = NEIGHBOURS_S) -> list[Neighbours]:
    """Consecutive images of one camera at most `within_s` apart, both with an attitude to compare."""
    pairs = []
    for camera in dict.fromkeys(each.image.camera for each in found):
        own = sorted((each for each in found if each.image.camera == camera), key=lambda each: each.image.pose.et)
        for first, second in pairwise(own):
            seconds = second.image.pose.et - first.image.pose.et
            if seconds <= within_s and first.turn_deg is not None and second.turn_deg is not None:
                pairs.append(_neighbours(first, second, seconds))
    return pairs


def _neighbours(first: PublishedDifference, second: PublishedDifference, seconds: float) -> Neighbours:
    """The disagreement of the corrections, not of the attitudes: the body's own rotation in between is the kernels'."""
    turn = np.zeros(3) if first.turn_deg is None or second.turn_deg is None else second.turn_deg - first.turn_deg
    return Neighbours(first, second, seconds, turn, second.image.range_factor - first.image.range_factor)


def one_image_sigma(differences: Sequence[float]) -> float | None:
    """1-sigma error of one image from differences of pairs (each has the errors of two); robust, by the median."""
    if not differences:
        return None
    return sigma_about_zero(np.asarray(differences)) / np.sqrt(2)
