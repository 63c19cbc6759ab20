"""What confirms the pose of a close-up, and why it may be doubted."""

from typing import Any

import numpy as np

from catalog.reasons import Reason
from tasks.closeup.level import Level, map_pixel_km, on_body
from tasks.closeup.refine import Refined
from tasks.closeup.search import Search
from tasks.closeup.settings import CloseUpSettings
from tasks.closeup.uncertainty import Errors
from tasks.project.points import body_points, pixels_of_points
from tasks.simulate import Scene

# The refined pose must stay where the search found it, pixels of the search: its grid is about so coarse.
SAME_PLACE_PX = 4.0


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
    frame_map_px = np.radians(scene.map_frame_deg) * scene.target.mean_radius_km / map_pixel_km(scene)
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
        "sigma_map_px": float(np.hypot(np.hypot(errors.place_px / map_px, settings.map_error_px), frame_map_px)),
        "matched_to_map_px": errors.place_px / map_px,
        "sigmas": found.consensus.height,
        "next_best_sigmas": found.consensus.rival,
        "false_alarm": found.consensus.false_alarm,
        "limb_points": 0 if best.limb is None else len(best.limb.shift_px),
        "xy_px": (best.xy_px * level.n + (level.n - 1) / 2).round(1).tolist(),
        "left_px": (best.solution.left_px * level.n).round(2).tolist(),
    }


def doubt_of(
    figures: dict[str, Any], settings: CloseUpSettings, best: Refined, found: Search, scene: Scene
) -> str | None:
    """Why a match is doubtful, as `code: fault. Remedy.`"""
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
    elif drift_px(found, best, scene) > SAME_PLACE_PX * found.n:
        fault = "the single patches lead elsewhere than all together"
    else:
        return None
    return f"{Reason.CLOSE_UP_UNSURE}: {fault}. Compare the overlay with the image, or give a finer base map (--map)."


def drift_px(found: Search, best: Refined, scene: Scene) -> float:
    """How far the refinement moved what the frame shows, px RMS."""
    xy_px = on_body(best.pose, scene)
    points = body_points(best.pose, scene.camera, scene.target, xy_px)
    off = pixels_of_points(found.pose, scene.camera, points) - xy_px
    return float(np.sqrt(np.nanmean(np.sum(off**2, axis=-1))))
