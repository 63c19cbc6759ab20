"""Which explanation is the image's, and how it is told."""

from dataclasses import dataclass

import numpy as np

from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.target import find_target, known_targets
from tasks.diagnose.others import without_others
from tasks.diagnose.settings import DiagnoseSettings
from tasks.diagnose.suns import sun_azimuth_deg
from tasks.diagnose.trying import Explanation
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

MAP = "map-does-not-match"
OTHER = "another-body"


@dataclass(frozen=True)
class Diagnosis:
    """code, fault, remedy: as of a `PlanetposeError`. explanation: what explains the image; None where the frame itself
    is wrong."""

    code: str
    fault: str
    remedy: str
    explanation: Explanation | None


def diagnosis_of(
    found: list[Explanation], predicted: Pose, scene: Scene, settings: DiagnoseSettings
) -> Diagnosis | None:
    """The explanation that fits the image, and clearly better than the others; None when none does."""
    good = [e for e in found if is_good(e, scene, settings)]
    if not good:
        return None
    # What changes least is believed unless another one is clearly better.
    best = good[0]
    for other in good[1:]:
        if other.likeness > best.likeness + settings.better:
            best = other
    best = turned_or_mirrored(best, good, settings)
    name = best.candidate.name
    if name == "other-body":
        return told_of_other(best, scene)
    if name == "mirrored":
        return told_of_mirrored(best)
    if name == "rolled":
        return told_of_rolled(best)
    if name == "inverted":
        return told_of_inverted(best, scene)
    if name == "sun":
        return told_of_sun(best, predicted)
    if abs(best.size - 1) > settings.same_size:
        return told_of_size(best, predicted, scene, settings)
    if np.ptp(scene.basemap.albedo) > 0 and (best.markings is None or best.markings < settings.markings):
        return told_of_map(best, scene)
    return None


def incomplete_frame(observation: Observation, scene: Scene, settings: DiagnoseSettings) -> Diagnosis | None:
    """Whether so much of the frame is missing or flagged that this may be why nothing else explains it."""
    meant = np.uint16(Quality.MASKED_BY_USER | Quality.SATURATED)
    share = float(np.mean(~observation.usable & ((observation.quality & meant) == 0)))
    if share < settings.incomplete:
        return None
    return Diagnosis(
        "frame-incomplete",
        f"{share:.0%} of the frame's pixels are missing or flagged as bad, and the rest shows too little of "
        f"{scene.target.name} and its limb.",
        "Give the whole frame.",
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


def turned_or_mirrored(best: Explanation, good: list[Explanation], settings: DiagnoseSettings) -> Explanation:
    """A mirrored or turned picture where its markings are the map's, and the others' are not."""
    if best.markings is None:
        return best
    for other in good:
        if other.candidate.name not in ("mirrored", "rolled") or other.markings is None:
            continue
        if other.markings >= max(settings.markings, best.markings + settings.markings_better):
            best = other
    return best


def told_of_other(best: Explanation, scene: Scene) -> Diagnosis:
    """What the user is told."""
    x, y = scene.camera.project(best.pose.target_in_camera_km)
    pixels = (best.candidate.observation.quality & np.uint16(Quality.MASKED_BY_USER)) != 0
    rows, columns = np.nonzero(pixels)
    return Diagnosis(
        OTHER,
        f"another bright body is in the frame, at x {columns.min()}-{columns.max()}, y {rows.min()}-{rows.max()}: with "
        f"it masked, {scene.target.name} is found at ({x:.1f}, {y:.1f}).",
        "Mask the other body (--mask FILE), and give --start-offset where the search still takes it for the target.",
        best,
    )


def told_of_mirrored(best: Explanation) -> Diagnosis:
    """What the user is told."""
    return Diagnosis(
        "image-mirrored",
        "the picture is mirrored: with left and right exchanged, outline, shading and markings are the predicted ones.",
        "Give --flip x, or a camera file whose camera_from_instrument says how it is read out.",
        best,
    )


def told_of_rolled(best: Explanation) -> Diagnosis:
    """What the user is told."""
    return Diagnosis(
        "image-turned",
        f"the picture is turned: with the camera rolled by {best.candidate.detail:.0f} deg about its boresight (from "
        "+x towards +y), outline, shading and markings are the image's.",
        "Check camera_from_j2000 (rows: +X sample, +Y line, +Z boresight) and the camera's camera_from_instrument.",
        best,
    )


def told_of_inverted(best: Explanation, scene: Scene) -> Diagnosis:
    """What the user is told."""
    return Diagnosis(
        "image-inverted",
        f"the picture is a negative: {scene.target.name} is darker than the sky, and as its negative it fits.",
        "Give the picture with brightness growing with light.",
        best,
    )


def told_of_sun(best: Explanation, predicted: Pose) -> Diagnosis:
    """What the user is told."""
    here, there = sun_azimuth_deg(best.pose), sun_azimuth_deg(predicted)
    return Diagnosis(
        "sun-direction",
        f"the predicted direction of the Sun is not the image's: it is lit from about {here:.0f} deg in the picture "
        f"(from +x towards +y) at a phase angle of about {best.pose.phase_deg:.0f} deg, predicted are {there:.0f} and "
        f"{predicted.phase_deg:.0f} deg.",
        "Check sun_from_target_km, the time, and camera_from_j2000: a camera turned about its boresight looks so.",
        best,
    )


def told_of_size(best: Explanation, predicted: Pose, scene: Scene, settings: DiagnoseSettings) -> Diagnosis:
    """What the user is told."""
    size, focal_px = best.size, scene.camera.focal_length_px * best.size
    radius = disk_radius_px(predicted, scene.camera, scene.target)
    seen = (
        f"the disk in the image is {size:.3f} times as wide as predicted ({size * radius:.1f} px in radius, not "
        f"{radius:.1f})"
    )
    for factor, mode in ((0.5, "summed 2x2"), (0.25, "summed 4x4"), (2.0, "not summed")):
        if abs(size / factor - 1) <= settings.summed_size:
            return Diagnosis(
                "summing-mode",
                f"{seen}: the frame is {mode}, the camera's focal length in pixels is another one, or the range is.",
                f"Give --camera FILE.toml with focal_length_px = {focal_px:.6g}; it fits the image.",
                best,
            )
    bodies = bodies_of_radius(max(scene.target.radii_km) * size, settings.bodies, scene.target.name)
    other = f", or --target {bodies[0]}" if len(bodies) == 1 else f", or another target ({', '.join(bodies)})"
    return Diagnosis(
        "disk-size",
        f"{seen}: the range, the focal length (camera, summing mode) or the target is not the image's.",
        f"A range of {predicted.range_km / size:.6g} km fits, or focal_length_px = {focal_px:.6g}"
        f"{other if bodies else ''}.",
        best,
    )


def bodies_of_radius(radius_km: float, tolerance: float, but: str) -> list[str]:
    """Targets of the catalog, at most four, whose largest radius is so large."""
    radii = {name: max(find_target(name).radii_km) for name in known_targets() if name != but}
    near = {name: abs(radius / radius_km - 1) for name, radius in radii.items()}
    return sorted((name for name in near if near[name] <= tolerance), key=lambda name: near[name])[:4]


def told_of_map(best: Explanation, scene: Scene) -> Diagnosis:
    """What the user is told."""
    x, y = scene.camera.project(best.pose.target_in_camera_km)
    agreement = "" if best.markings is None else f" (they correlate by {best.markings:.2f})"
    return Diagnosis(
        MAP,
        f"the markings of the base map {scene.basemap.name} are not the image's{agreement}: without them, outline and "
        f"shading fit, with the centre at ({x:.1f}, {y:.1f}) and a range factor of {1 / best.size:.4f}.",
        "Clouds, another map or another face mislead; --map none leaves the markings out.",
        best,
    )
