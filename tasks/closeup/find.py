"""Close-ups: the pose of a frame that shows little or nothing of the limb, by matching it to the base map."""

from collections.abc import Callable
from typing import Any

import numpy as np

from catalog.errors import RefusedError
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.closeup.figures import doubt_of, patch_figures
from tasks.closeup.level import Level, map_pixel_km, pixel_km
from tasks.closeup.motion import RANGE, ROLL, SIZE
from tasks.closeup.refine import Refined, refined
from tasks.closeup.search import Prior, Search, not_matched, refuse_chance, searched
from tasks.closeup.settings import CloseUpSettings
from tasks.closeup.uncertainty import UNKNOWNS, errors_of
from tasks.correction import FORMAL, Correction
from tasks.joint.parameters import ATTITUDE, State, difference
from tasks.priors import PriorSettings
from tasks.simulate import Scene

Progress = Callable[[str, int, str], None]

# The refinement works on frames of no more pixels across.
LARGEST_PX = 1024
AMBIGUOUS = "without a limb a turn of the body cannot be distinguished from one of the camera"


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
    off = np.where(np.isin(range(SIZE), (ROLL, RANGE)), found.consensus.step, 0.0)
    off[RANGE] += np.log(pose.range_km / predicted.range_km)
    best, start, map_error_px = None, found.pose, settings.map_error_px * map_px
    coarsest_left = int(np.ceil(max(scene.camera.size_px) / LARGEST_PX))
    finest = max(1, round(map_px / settings.map_pixel_px), coarsest_left)
    for n in sorted({found.n, min(found.n, finest)}, reverse=True):
        level = Level.of(observation, scene, n)
        nearer = refined(level, start, off, prior.of_motion, map_error_px / n, settings.patches)
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
    to_frame = np.array([level.n, level.n, *(SIZE - 2) * [1.0]])
    covariance = best.solution.covariance * np.outer(to_frame, to_frame)
    open_deg = prior.attitude_deg if best.limb is None else 0.0
    errors = errors_of(best.pose, scene, covariance, settings.map_error_px * map_px, open_deg)
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
    doubt = doubt_of(figures, settings, best, found, scene)
    if doubt:
        evidence["doubt"] = doubt
    sure = figures["false_alarm"] <= settings.false_alarm
    evidence["orientation"] = {
        "verdict": "matched" if sure else "undetermined",
        "correlation": None,
        "sigmas": figures["sigmas"],
        "kept": AMBIGUOUS if best.limb is None else None,
    }
    changed: dict[str, Any] = {"offset_px": step[:2].tolist(), "range_factor": range_factor, "roll_deg": float(step[3])}
    changed["attitude_deg"] = None if best.limb is None else step[ATTITUDE].tolist()
    return Correction("closeup", best.pose, changed, stated, evidence, converged=best.settled)
