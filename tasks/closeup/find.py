"""Close-ups: the pose of a frame that shows little or nothing of the limb, by matching it to the base map."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError, RefusedError
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.closeup.consensus import Consensus, agreed, grid
from tasks.closeup.level import Level, map_pixel_km, pixel_km
from tasks.closeup.motion import RANGE, ROLL, Anchor, moved, responses
from tasks.closeup.refine import Refined, refined
from tasks.closeup.settings import CloseUpSettings
from tasks.closeup.uncertainty import UNKNOWNS, Errors, errors_of
from tasks.correction import FORMAL, Correction
from tasks.joint.parameters import State, difference
from tasks.priors import PriorSettings
from tasks.simulate import Scene

Array = NDArray[np.float64]
Progress = Callable[[str, int, str], None]

FEWEST_PATCHES = 6
# The scatter of the summed correlations is learned at least so far around, pixels of the comparison; the refinement
# works on frames of no more than so many.
LEAST_REACH_PX, LARGEST_PX = 24, 1024
# The refined pose must stay where the search found it, pixels of the search: its grid is about so coarse.
SAME_PLACE_PX = 4.0
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
        """(4,), see `closeup.motion`: inf for the pointing."""
        return np.array([np.inf, np.inf, self.roll_deg, self.range])


@dataclass(frozen=True)
class Search:
    """What all patches agree on, at n x n pixels: the pose there, and how sure it is."""

    pose: Pose
    n: int
    consensus: Consensus
    patches: int


def find_close_up(
    observation: Observation,
    pose: Pose,
    predicted: Pose,
    scene: Scene,
    settings: CloseUpSettings,
    priors: PriorSettings,
    progress: Progress | None = None,
) -> Correction:
    """Correct pointing, roll and range of a frame by patches of the base map; the body's orientation stays.

    predicted: what the priors are about. Raises RefusedError where there is no map, or one too coarse for the frame;
    FailedError where nothing within the search matches.
    """
    map_px = refuse_without_map(pose, scene, settings)
    prior = Prior.of(priors, predicted, settings)
    found = searched(observation, pose, scene, prior, settings, map_px)
    if progress:
        progress("closeup", 0, f"search: {found.consensus.height:.1f} sigmas of {found.patches} patches")
    refuse_chance(found, settings)
    off = np.array([0.0, 0.0, found.consensus.step[ROLL], found.consensus.step[RANGE]])
    off[RANGE] += np.log(pose.range_km / predicted.range_km)
    best, start = None, found.pose
    coarsest_left = int(np.ceil(max(scene.camera.size_px) / LARGEST_PX))
    finest = max(1, round(map_px / settings.map_pixel_px), coarsest_left)
    for n in sorted({found.n, min(found.n, finest)}, reverse=True):
        level = Level.of(observation, scene, n)
        nearer = refined(level, start, off, prior.of_motion, settings.patches)
        if nearer is None:
            break
        best, start, off = (nearer, level), nearer.pose, nearer.off
        if progress:
            progress("closeup", len(nearer.moves_px), f"moved {nearer.moves_px[-1]:.3f} px")
    if best is None:
        raise not_matched(f"of {found.patches} patches too few have a match of their own nearby.")
    return corrected(pose, scene, settings, prior, map_px, found, *best)


def refuse_without_map(pose: Pose, scene: Scene, settings: CloseUpSettings) -> float:
    """Side of a pixel of the map, px of the frame. Raises RefusedError where there is none, or too few are in sight."""
    name, albedo = scene.target.name, scene.basemap.albedo
    if np.ptp(albedo) == 0:
        raise RefusedError(
            Reason.NO_LIMB,
            f"the frame shows too little of the limb of {name}, and there is no base map to match it to.",
            "Give a base map (--map FILE).",
        )
    scale = pixel_km(pose, scene)
    if not np.isfinite(scale):
        raise RefusedError(
            Reason.TARGET_NOT_FOUND, f"the predicted pose has no part of {name} in the frame.", "Check the pose."
        )
    map_px = map_pixel_km(scene) / scale
    across = min(scene.camera.size_px) / map_px
    if across < settings.min_map_pixels:
        raise RefusedError(
            Reason.MAP_TOO_COARSE,
            f"the frame is only {across:.1f} pixels of the base map across ({map_pixel_km(scene):.1f} km each), needed "
            f"{settings.min_map_pixels:g}.",
            "Give a finer base map (--map FILE).",
        )
    return map_px


def searched(
    observation: Observation, pose: Pose, scene: Scene, prior: Prior, settings: CloseUpSettings, map_px: float
) -> Search:
    """The motion that all patches agree on. Raises FailedError where there are too few patches."""
    n = max(1, round(map_px / settings.map_pixel_px), int(np.ceil(max(scene.camera.size_px) / settings.largest_px)))
    level = Level.of(observation, scene, n)
    camera, target = level.scene.camera, level.scene.target
    xy = level.on_body(pose)
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


def corrected(
    pose: Pose,
    scene: Scene,
    settings: CloseUpSettings,
    prior: Prior,
    map_px: float,
    found: Search,
    best: Refined,
    level: Level,
) -> Correction:
    """The correction, with its covariance and what confirms it."""
    to_frame = np.array([level.n, level.n, 1.0, 1.0])
    covariance = best.solution.covariance * np.outer(to_frame, to_frame)
    errors = errors_of(
        best.pose, scene, covariance, settings.map_error_px * map_px, prior.attitude_deg, scene.map_frame_deg
    )
    figures = patch_figures(scene, settings, map_px, found, best, level, errors)
    sigma = np.sqrt(np.diag(errors.covariance))
    step = difference(State(best.pose, 1.0), State(pose, 1.0), scene.camera)
    range_factor = best.pose.range_km / pose.range_km
    stated = {
        "offset_px": sigma[:2].tolist(),
        "range_factor": float(range_factor * sigma[2]),
        "roll_deg": float(sigma[3]),
        "attitude_deg": sigma[4:].tolist(),
    }
    evidence: dict[str, Any] = {
        "patches": figures,
        "unknowns": list(UNKNOWNS),
        "covariance": errors.covariance.tolist(),
        "map_frame_deg": scene.map_frame_deg,
        "history_px": best.moves_px,
        "reduction": level.n,
        FORMAL: {"offset_px": [errors.place_px, errors.place_px]},
    }
    doubt = doubt_of(figures, settings, best, found, scene, level)
    if doubt:
        evidence["doubt"] = doubt
    sure = figures["false_alarm"] <= settings.false_alarm
    evidence["orientation"] = {
        "verdict": "matched" if sure else "undetermined",
        "correlation": None,
        "sigmas": figures["sigmas"],
        "kept": "a close-up cannot tell a turn of the body from one of the camera",
    }
    changed = {"offset_px": step[:2].tolist(), "range_factor": range_factor, "roll_deg": float(step[3])}
    return Correction("closeup", best.pose, changed | {"attitude_deg": None}, stated, evidence, converged=best.settled)


def patch_figures(
    scene: Scene,
    settings: CloseUpSettings,
    map_px: float,
    found: Search,
    best: Refined,
    level: Level,
    errors: Errors,
) -> dict[str, Any]:
    """What confirms the pose, as results state it: see docs/method/closeup.md."""
    left_map_px = np.hypot(*best.solution.left_px.T) * level.n / map_px
    agree = left_map_px < 1.0
    rms = float(np.sqrt(np.mean(left_map_px[agree] ** 2))) if agree.any() else None
    return {
        "tried": best.tried,
        "agreeing": int(np.count_nonzero(agree)),
        "rms_px": None if rms is None else rms * map_px,
        "rms_map_px": rms,
        "map_pixel_km": map_pixel_km(scene),
        "map_pixel_px": map_px,
        "sigma_map_px": float(np.hypot(errors.place_px / map_px, settings.map_error_px)),
        "matched_to_map_px": errors.place_px / map_px,
        "sigmas": found.consensus.height,
        "next_best_sigmas": found.consensus.rival,
        "false_alarm": found.consensus.false_alarm,
        "xy_px": (best.xy_px * level.n + (level.n - 1) / 2).round(1).tolist(),
        "left_px": (best.solution.left_px * level.n).round(2).tolist(),
    }


def doubt_of(
    figures: dict[str, Any], settings: CloseUpSettings, best: Refined, found: Search, scene: Scene, level: Level
) -> str | None:
    """Why a match is doubtful, as `code: fault. Remedy.`"""
    xy = level.on_body(best.pose)
    if figures["false_alarm"] > settings.false_alarm:
        fault = (
            f"chance gives as good a match with a probability of {figures['false_alarm']:.1g} (sure to "
            f"{settings.false_alarm:g})"
        )
    elif figures["matched_to_map_px"] > settings.max_sigma_map_px:
        fault = (
            f"the patches leave the place open by {figures['matched_to_map_px']:.1f} pixels of the base map, 1-sigma "
            f"(sure to {settings.max_sigma_map_px:g})"
        )
    elif not best.settled:
        fault = f"the fit to the patches did not come to rest (last move {best.moves_px[-1]:.2f} px)"
    elif drift_px(found, best, scene, xy * level.n) > SAME_PLACE_PX * found.n:
        fault = "the single patches lead elsewhere than all together"
    else:
        return None
    return f"{Reason.CLOSE_UP_UNSURE}: {fault}. Compare the overlay with the image, or give a finer base map (--map)."


def drift_px(found: Search, best: Refined, scene: Scene, xy_px: Array) -> float:
    """How far the refinement moved what the frame shows, RMS over pixels (n, 2)."""
    from tasks.project.points import body_points, pixels_of_points

    points = body_points(best.pose, scene.camera, scene.target, xy_px)
    off = pixels_of_points(found.pose, scene.camera, points) - xy_px
    return float(np.sqrt(np.nanmean(np.sum(off**2, axis=-1))))
