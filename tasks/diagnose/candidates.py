"""What is tried where an image has no corrected pose: candidates, each with one thing changed, in families by what that
is."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from catalog.flips import Flip, flipped
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from tasks.diagnose.others import without_others
from tasks.diagnose.settings import DiagnoseSettings
from tasks.diagnose.sky import without_stray_light
from tasks.joint.parameters import rolled
from tasks.simulate import Scene
from tasks.simulate.suns import sun_azimuth_deg, with_sun
from tasks.simulate.window import disk_radius_px

Name = Literal[
    "as-predicted",
    "other-body",
    "unmasked",
    "stray-light",
    "blurred",
    "smeared",
    "size",
    "sun",
    "mirrored",
    "rolled",
    "inverted",
]
MIRRORED: tuple[Flip, ...] = ("x", "y", "transpose", "antitranspose")
TURNED: tuple[Flip, ...] = ("rot90", "rot180", "rot270")
BACK: dict[Flip, Flip] = {"rot90": "rot270", "rot270": "rot90"}


@dataclass(frozen=True)
class Candidate:
    """One thing changed: the pose, or the picture. detail: by how much, in the family's own measure. flip: how the
    picture was flipped, None for the frame as it is. psf_px: width of a blur other than the scene's, None for that.
    trail_px: (x, y) of a line along which the exposure spread every point."""

    name: Name
    detail: float
    observation: Observation
    pose: Pose
    flip: Flip | None = None
    psf_px: float | None = None
    trail_px: tuple[float, float] = (0.0, 0.0)

    def seen_by(self, scene: Scene) -> Scene:
        """The scene with the candidate's own blur."""
        changes: dict[str, Any] = {} if self.psf_px is None else {"psf_sigma_px": self.psf_px}
        if self.trail_px != (0.0, 0.0):
            changes["trail_px"] = self.trail_px
        return replace(scene, settings=scene.settings.model_copy(update=changes)) if changes else scene


def families(
    observation: Observation, pose: Pose, scene: Scene, settings: DiagnoseSettings
) -> Iterator[list[Candidate]]:
    """Candidates, by what they change; the predicted pose first, then what changes least."""
    yield [Candidate("as-predicted", 1.0, observation, pose)]
    others = without_others(observation, pose, scene)
    if others:
        yield [Candidate("other-body", 1.0, others.observation, pose)]
    if (observation.quality & np.uint16(Quality.MASKED_BY_USER)).any():
        yield [Candidate("unmasked", 1.0, unmasked(observation), pose)]
    even = without_stray_light(observation)
    if even:
        yield [Candidate("stray-light", even.span, even.observation, pose)]
    radius = disk_radius_px(pose, scene.camera, scene.target)
    widths = [share * radius for share in settings.blurs]
    yield [
        Candidate("blurred", width, observation, pose, psf_px=width) for width in widths if width > scene.psf_sigma_px
    ]
    yield list(trails(observation, pose, radius, settings))
    yield [Candidate("size", size, observation, pose.with_range_factor(1 / size)) for size in settings.sizes]
    azimuths = sun_azimuth_deg(pose) + 360 * np.arange(settings.azimuths) / settings.azimuths
    phases = (pose.phase_deg, *settings.phases_deg)
    suns = [(azimuth, phase) for phase in phases for azimuth in azimuths]
    yield [Candidate("sun", azimuth, observation, with_sun(pose, azimuth, phase)) for azimuth, phase in suns[1:]]
    square = len(set(observation.image.shape)) == 1
    for flip in MIRRORED if square else MIRRORED[:2]:
        yield [Candidate("mirrored", 1.0, flipped_as(observation, flip), pose, flip)]
    for turn_deg, flip in zip((270.0, 180.0, 90.0), TURNED, strict=True):
        if square or flip == "rot180":
            yield [Candidate("rolled", turn_deg, flipped_as(observation, flip), pose, flip)]
        else:
            yield [Candidate("rolled", turn_deg, observation, rolled(pose, turn_deg))]
    yield [Candidate("inverted", 1.0, replace(observation, image=-observation.image), pose)]


def trails(observation: Observation, pose: Pose, radius_px: float, settings: DiagnoseSettings) -> Iterator[Candidate]:
    """Exposures during which the boresight drifted along a line, in every direction."""
    for share in settings.trails:
        for angle in np.pi * np.arange(settings.trail_directions) / settings.trail_directions:
            x, y = (share * radius_px * float(part) for part in (np.cos(angle), np.sin(angle)))
            yield Candidate("smeared", share * radius_px, observation, pose, trail_px=(x, y))


def flipped_as(observation: Observation, flip: Flip) -> Observation:
    """The observation flipped as a whole."""
    return Observation(*(flipped(plane, flip) for plane in (observation.image, observation.noise, observation.quality)))


def unmasked(observation: Observation) -> Observation:
    """The observation without the user's mask."""
    kept = observation.quality & ~np.uint16(Quality.MASKED_BY_USER)
    return replace(observation, quality=kept)
