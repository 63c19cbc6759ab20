"""What covers the lit limb where the target is found and its limb is not measured."""

import numpy as np

from catalog.observation import Observation, Quality
from catalog.reasons import Reason
from tasks.compare.limb_edges import lit_limit_deg, measure_limb
from tasks.compare.match import framed_window, match_scene
from tasks.compare.segments import limb_segments, profiles
from tasks.diagnose.diagnosis import Diagnosis
from tasks.diagnose.settings import DiagnoseSettings
from tasks.diagnose.trials import Explanation
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px
from tasks.validate.limb import ValidateSettings, margin_px

LIMB = ValidateSettings()
FLAGS = {
    Reason.LIMB_OUTSIDE: Quality(0),
    Reason.LIMB_SATURATED: Quality.SATURATED,
    Reason.LIMB_MASKED: Quality.MASKED_BY_USER,
    Reason.LIMB_MISSING: Quality.MISSING | Quality.RESEAU | Quality.OUTSIDE_WINDOW,
}
# Code, what is said of it, and what to do; in the order in which a segment is counted.
COVERS = {
    Reason.LIMB_OUTSIDE: ("beyond the edge of the frame", "Only frames that show a lit limb can be corrected."),
    Reason.LIMB_SATURATED: (
        "on saturated pixels",
        "Choose a shorter exposure: a clipped limb does not tell where it is.",
    ),
    Reason.LIMB_MASKED: ("on pixels that the mask takes out", "Give a mask that leaves the lit limb free."),
    Reason.LIMB_MISSING: (
        "on missing or flagged pixels",
        "Give the whole picture, or check what flags its pixels (reseau marks, filling).",
    ),
    Reason.LIMB_FAINT: (
        "where its step does not stand out of the noise",
        "Choose a longer exposure, or average frames.",
    ),
}


def covered_limb(
    observation: Observation, found: Explanation, scene: Scene, settings: DiagnoseSettings
) -> Diagnosis | None:
    """What covers most of the lit limb of the target where it was found; None where enough of it is free. The map's
    markings are not needed for it."""
    shares = shares_of_limb(observation, found, scene)
    if shares is None or shares["free"] >= settings.limb_left:
        return None
    worst = max(COVERS, key=lambda cover: shares[cover])
    if shares[worst] < 0.5 * (1 - shares["free"]):
        return None
    where, remedy = COVERS[worst]
    x, y = scene.camera.project(found.pose.target_in_camera_km)
    parts = [f"{shares[cover]:.0%} {COVERS[cover][0]}" for cover in COVERS if cover != worst and shares[cover] >= 0.05]
    rest = f" ({', '.join(parts)})" if parts else ""
    return Diagnosis(
        worst,
        f"the lit limb of {scene.target.name}, found near ({x:.0f}, {y:.0f}), cannot be measured: {shares[worst]:.0%} "
        f"of it lies {where}{rest}.",
        remedy,
        found,
    )


def shares_of_limb(observation: Observation, found: Explanation, scene: Scene) -> dict[str, float] | None:
    """Shares of the lit limb's segments that are free (they could be measured) or covered, by cover; None where no
    part of the limb is lit."""
    pose = found.pose
    fine = scene.coarser(pose, 300.0)
    radius = disk_radius_px(pose, scene.camera, scene.target)
    segments = limb_segments(pose, scene)
    lit = segments.chosen(segments.incidence_deg < lit_limit_deg(pose.phase_deg, LIMB, radius))
    if len(lit) == 0:
        return None
    match = match_scene(observation, fine, pose, framed_window(fine, pose, margin_px=margin_px(LIMB)))
    free = measure_limb(match, LIMB).tried if match.usable.any() else 0
    left = np.ones(len(lit), bool)
    counts: dict[Reason, int] = {}
    for cover, flag in FLAGS.items():
        pixels = profiles(((observation.quality & np.uint16(flag)) != 0).astype(float), lit, (0, 0), LIMB.half_px)
        hit = left & (~np.isfinite(pixels) if cover == Reason.LIMB_OUTSIDE else pixels > 0).any(axis=1)
        counts[cover] = int(np.count_nonzero(hit))
        left &= ~hit
    counts[Reason.LIMB_FAINT] = max(int(np.count_nonzero(left)) - free, 0)
    shares = {cover: count / len(lit) for cover, count in counts.items()}
    return shares | {"free": free / len(lit)}
