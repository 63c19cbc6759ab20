"""The place on the map that all patches of a close-up agree on, within what is known before."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.closeup.consensus import Consensus, agreed, grid
from tasks.closeup.level import Level, on_body
from tasks.closeup.motion import RANGE, ROLL, Anchor, moved, responses
from tasks.closeup.settings import CloseUpSettings
from tasks.priors import PriorSettings
from tasks.simulate import Scene

Array = NDArray[np.float64]

FEWEST_PATCHES = 6
# The scatter of the summed correlations is learned at least so far around, pixels of the comparison.
LEAST_REACH_PX = 24
REMEDY = (
    "Check target, base map, range and the camera's roll; the surface may lie farther from its predicted place than "
    "closeup.reach_px of the profile: raise it, or say where the target's centre is with --start-offset."
)


@dataclass(frozen=True)
class Prior:
    """1-sigma of what is known before: roll, degrees; logarithm of the range factor; the body's orientation about each
    axis, degrees. 0 where held."""

    roll_deg: float
    range: float
    attitude_deg: float

    @classmethod
    def of(cls, priors: PriorSettings, pose: Pose, settings: CloseUpSettings) -> "Prior":
        """Of the metadata's errors, as far as the settings look for them. A turn of the body about the line of sight
        looks like a roll."""
        attitude = priors.attitude_deg or np.inf
        roll = min(float(np.hypot(priors.roll_deg or np.inf, attitude)), settings.max_roll_deg / settings.sigmas)
        far = min(priors.range_sigma(pose.range_km), settings.max_range / settings.sigmas)
        hold = settings.hold
        return cls(
            0.0 if "roll" in hold else roll,
            0.0 if "range" in hold else far,
            0.0 if "attitude" in hold else min(attitude, settings.max_roll_deg),
        )

    @property
    def of_motion(self) -> Array:
        """(7,), see `closeup.motion`: inf for the pointing."""
        return np.array([np.inf, np.inf, self.roll_deg, self.range, *3 * [self.attitude_deg]])


@dataclass(frozen=True)
class Search:
    """What all patches agree on, at n x n pixels: the pose there, and how sure it is."""

    pose: Pose
    n: int
    consensus: Consensus
    patches: int


def searched(
    observation: Observation, pose: Pose, scene: Scene, prior: Prior, settings: CloseUpSettings, map_px: float
) -> Search:
    """The motion that all patches agree on. Raises FailedError where there are too few patches."""
    n = max(1, round(map_px / settings.map_pixel_px), int(np.ceil(max(scene.camera.size_px) / settings.largest_px)))
    level = Level.of(observation, scene, n)
    camera, target = level.scene.camera, level.scene.target
    xy = on_body(pose, level.scene)
    anchor = Anchor.at(pose, camera, target, xy)
    every = responses(pose, camera, target, anchor, xy)
    most = np.nanmax(np.hypot(every[:, 0], every[:, 1]), axis=0)
    rolls = grid(prior.roll_deg, settings.max_roll_deg, settings.sigmas, most[ROLL])
    ranges = grid(prior.range, settings.max_range, settings.sigmas, most[RANGE])
    search = int(np.ceil(settings.reach_px / n))
    reach = max(search, LEAST_REACH_PX)
    extra = int(np.ceil(most[ROLL] * rolls.max() + most[RANGE] * ranges.max())) + 1
    surfaces = level.surfaces(pose, reach + extra, settings.patches)
    if len(surfaces) < FEWEST_PATCHES:
        raise not_matched(
            f"only {len(surfaces)} patches of the frame show a lit surface that the base map covers (needed "
            f"{FEWEST_PATCHES})."
        )
    response = responses(pose, camera, target, anchor, surfaces.centre_px)
    response = np.where(np.isfinite(response), response, np.nanmedian(response, axis=0))
    consensus = agreed(surfaces, response, rolls, ranges, reach, search)
    return Search(moved(pose, camera, anchor, consensus.step), n, consensus, len(surfaces))


def refuse_chance(found: Search, settings: CloseUpSettings) -> None:
    """Raise FailedError where chance may well have given the match."""
    if found.consensus.false_alarm > settings.no_match:
        raise not_matched(
            f"nowhere within {settings.reach_px:g} px of the predicted place do image and base map agree better than "
            f"by chance (best of {found.patches} patches: probability {found.consensus.false_alarm:.1g}, needed "
            f"{settings.no_match:g})."
        )


def not_matched(fault: str) -> FailedError:
    """The failure of a close-up that is found nowhere on the map."""
    return FailedError(Reason.CLOSE_UP_NOT_MATCHED, fault, REMEDY)
