"""Which explanation is the image's, and its message."""

from statistics import NormalDist

import numpy as np

from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.diagnose.diagnosis import OTHER, Diagnosis, diagnosis_for, map_diagnosis
from tasks.diagnose.evidence import better_by, better_than_sky
from tasks.diagnose.obstacles import covered_limb
from tasks.diagnose.others import without_others
from tasks.diagnose.settings import DiagnoseSettings
from tasks.diagnose.trials import Explanation, Tried
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px
from tasks.validate.blocks import blocks_of

FLIPS = ("mirrored", "rolled")
SPREAD = ("blurred", "smeared")
# Side of the blocks of JPEG: they move a limb by half of it at most.
BLOCK_PX = 8


def cause_of(
    all_tried: Tried, observation: Observation, predicted: Pose, scene: Scene, settings: DiagnoseSettings
) -> Diagnosis | None:
    """The explanation that fits; where none does, what spreads the light, or covers the target or its limb; None where
    nothing is certain."""
    diagnosis = diagnosis_of(all_tried, predicted, scene, settings)
    if diagnosis is not None and diagnosis.code == Reason.DISK_SIZE and diagnosis.explanation is not None:
        off_px = abs(diagnosis.explanation.size - 1) * disk_radius_px(predicted, scene.camera, scene.target)
        return (compressed(observation, settings) if off_px < BLOCK_PX / 2 else None) or diagnosis
    if diagnosis is not None:
        return diagnosis
    first = predicted_one(all_tried)
    spread = spread_of(all_tried, settings)
    if spread is not None:
        return diagnosis_for(spread, predicted, scene, settings)
    if first and first.likeness >= settings.sure_likeness and is_no_chance(first, all_tried, settings):
        covered = covered_limb(observation, first, scene, settings)
        if covered is not None:
            return covered
    return (
        hidden_by_other(observation, predicted, scene)
        or incomplete_frame(observation, scene, settings)
        or compressed(observation, settings)
    )


def predicted_one(all_tried: Tried) -> Explanation | None:
    """The explanation that changes nothing; None where it could not be looked for."""
    return next((e for e in all_tried.found if e.candidate.name == "as-predicted"), None)


def diagnosis_of(all_tried: Tried, predicted: Pose, scene: Scene, settings: DiagnoseSettings) -> Diagnosis | None:
    """The explanation that fits the image, significantly better than the predicted one and than chance, and than the
    others that do; None when none does."""
    best = explanation_of(all_tried, settings, scene)
    if best is None:
        return None
    if best.candidate.name != "as-predicted" or abs(best.size - 1) > settings.same_size:
        return diagnosis_for(best, predicted, scene, settings)
    if np.ptp(scene.basemap.albedo) > 0 and (best.markings is None or best.markings < settings.markings):
        return map_diagnosis(best, scene)
    return None


def explanation_of(all_tried: Tried, settings: DiagnoseSettings, scene: Scene) -> Explanation | None:
    """The one that is accepted; the predicted one where nothing else is better, None when that does not fit either."""
    found = all_tried.found
    first = predicted_one(all_tried)
    good = [e for e in found if is_good(e, scene, settings) and is_no_chance(e, all_tried, settings)]
    rivals = [e for e in good if e is not first and (first is None or is_better(e, first, all_tried, settings))]
    if first in good and first is not None:  # markings that are the map's as they are say that nothing is flipped
        rivals = [
            e for e in rivals
            if e.candidate.name not in FLIPS or not is_marked(first, e.markings or 0.0, all_tried, settings)
        ]  # fmt: skip
    best = first if first in good else None
    # What changes least is accepted unless another one is better than it, too.
    for rival in rivals:
        if best is None or best is first or is_better(rival, best, all_tried, settings):
            best = rival
    return flip_shown_by_markings(first, best, good, all_tried, settings) or best


def spread_of(all_tried: Tried, settings: DiagnoseSettings) -> Explanation | None:
    """A blurred or smeared picture: its limb is too wide to be measured, so that shading and outline alone must show
    it, beyond chance, and better than anything else that was tried does. None where they do not."""
    first = predicted_one(all_tried)
    spread = [e for e in all_tried.found if e.candidate.name in SPREAD and e.likeness >= settings.spread_likeness]
    for e in spread:
        others = [other for other in all_tried.found if other is not e]
        is_best = all(e.fit and other.fit and better_by(e.fit, other.fit)[0] >= 1 for other in others)
        if first and is_best and is_better(e, first, all_tried, settings) and is_no_chance(e, all_tried, settings):
            return e
    return None


def is_better(e: Explanation, other: Explanation, all_tried: Tried, settings: DiagnoseSettings) -> bool:
    """Whether one explanation leaves so much less of the image unexplained than another one that this is no accident,
    however many were tried."""
    if e.fit is None or other.fit is None:
        return False
    ratio, sigmas = better_by(e.fit, other.fit)
    return ratio >= settings.better and sigmas >= -NormalDist().inv_cdf(settings.false_alarm / all_tried.hypotheses)


def is_no_chance(e: Explanation, all_tried: Tried, settings: DiagnoseSettings) -> bool:
    """Whether an explanation fits better than one of so many would somewhere in a frame without a target."""
    if e.fit is None:
        return False
    looks = all_tried.hypotheses * all_tried.places
    return better_than_sky(e.fit)[1] >= np.log(looks / settings.false_alarm)


def incomplete_frame(observation: Observation, scene: Scene, settings: DiagnoseSettings) -> Diagnosis | None:
    """Whether so much of the frame is missing or flagged that this may be why nothing else explains it."""
    meant = np.uint16(Quality.MASKED_BY_USER | Quality.SATURATED)
    share = float(np.mean(~observation.usable & ((observation.quality & meant) == 0)))
    if share < settings.incomplete:
        return None
    most = "more than 99%" if share > 0.99 else f"{share:.0%}"
    return Diagnosis(
        Reason.FRAME_INCOMPLETE,
        f"{most} of the frame's pixels are missing or flagged as bad, and the rest shows too little of "
        f"{scene.target.name} and its limb.",
        "Give the whole frame.",
        None,
    )


def compressed(observation: Observation, settings: DiagnoseSettings) -> Diagnosis | None:
    """Whether compression has spoilt the picture so much that this may be why nothing else explains it."""
    blocks = blocks_of(observation)
    if blocks is None or blocks <= settings.blocks:
        return None
    return Diagnosis(
        Reason.COMPRESSION_BLOCKS,
        f"the picture shows the blocks of a strong compression (steps {blocks:.1f} times as large at their edges as "
        "elsewhere), and nothing else explains it as well.",
        "Take a version with less compression.",
        None,
    )


def hidden_by_other(observation: Observation, predicted: Pose, scene: Scene) -> Diagnosis | None:
    """Whether a body that is too large to be the target is in the frame, where nothing is found beside it."""
    others = without_others(observation, predicted, scene)
    if others is None:
        return None
    rows, columns = np.nonzero(others.pixels)
    return Diagnosis(
        OTHER,
        f"another bright body, too large to be {scene.target.name} at its predicted range, is in the frame, at "
        f"x {columns.min()}-{columns.max()}, y {rows.min()}-{rows.max()}; the target is found neither beside it nor in "
        "front of it.",
        "Check target, range and Sun direction: in front of that body and beside it the target was looked for, too.",
        None,
    )


def is_good(found: Explanation, scene: Scene, settings: DiagnoseSettings) -> bool:
    """Whether an explanation fits outline and shading of the image."""
    if found.fault is not None or found.limb_px is None:
        return False
    radius = disk_radius_px(found.pose, scene.camera, scene.target)
    near = found.limb_px <= max(settings.limb_px, settings.limb_share * radius)
    return near and found.limb_share >= settings.least_limb and found.likeness >= settings.least_likeness


def flip_shown_by_markings(
    first: Explanation | None,
    best: Explanation | None,
    good: list[Explanation],
    all_tried: Tried,
    settings: DiagnoseSettings,
) -> Explanation | None:
    """A mirrored or turned picture whose markings are the map's, where the predicted one's and the best one's are not:
    at low phase angles outline and shading do not tell. None when there is none."""
    flips = [e for e in good if e.candidate.name in FLIPS and e.markings is not None]
    others = [e for e in (first, best) if e is not None and e.candidate.name not in FLIPS]
    shown = None
    for flip in flips:
        rivals = [e.markings or 0.0 for e in [*others, *([shown] if shown else [])]]
        if is_marked(flip, max(rivals, default=0.0), all_tried, settings):
            shown = flip
    return shown


def is_marked(e: Explanation, rival: float, all_tried: Tried, settings: DiagnoseSettings) -> bool:
    """Whether an explanation's markings are the map's, and more so than another's correlation (-1..1), beyond chance
    (Fisher's transformation of a correlation)."""
    if e.markings is None or e.markings < max(settings.markings, rival + settings.markings_better):
        return False
    sigma = 1 / np.sqrt(max(e.independent - 3, 1.0))
    apart = (np.arctanh(min(e.markings, 0.999)) - np.arctanh(np.clip(rival, 0, 0.999))) / sigma
    return bool(0.5 * apart**2 >= np.log(all_tried.hypotheses / settings.false_alarm))
