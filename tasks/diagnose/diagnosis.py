"""The message of an explanation: code, fault and remedy."""

from dataclasses import dataclass

import numpy as np

from catalog.flips import MEANINGS
from catalog.observation import Quality
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import find_target, known_targets
from tasks.diagnose.settings import DiagnoseSettings
from tasks.diagnose.trials import Explanation
from tasks.simulate import Scene
from tasks.simulate.suns import sun_azimuth_deg
from tasks.simulate.window import disk_radius_px

MAP = Reason.MAP_DOES_NOT_MATCH
OTHER = Reason.ANOTHER_BODY
STRAY = Reason.STRAY_LIGHT


@dataclass(frozen=True)
class Diagnosis:
    """code, fault, remedy: as of a `PlanetposeError`. explanation: what explains the image; None where the frame itself
    is wrong."""

    code: Reason
    fault: str
    remedy: str
    explanation: Explanation | None


def diagnosis_for(best: Explanation, predicted: Pose, scene: Scene, settings: DiagnoseSettings) -> Diagnosis:
    """The message of an explanation that is not the predicted one."""
    match best.candidate.name:
        case "other-body":
            return other_body_diagnosis(best, scene)
        case "unmasked":
            return unmasked_diagnosis(best, scene)
        case "stray-light":
            return stray_light_diagnosis(best, scene)
        case "blurred":
            return blurred_diagnosis(best, scene)
        case "smeared":
            return smeared_diagnosis(best)
        case "mirrored":
            return mirrored_diagnosis(best)
        case "rolled":
            return rolled_diagnosis(best)
        case "inverted":
            return inverted_diagnosis(best, scene)
        case "sun":
            return sun_diagnosis(best, predicted)
    return size_diagnosis(best, predicted, scene, settings)


def other_body_diagnosis(best: Explanation, scene: Scene) -> Diagnosis:
    """The message of this cause."""
    x, y = scene.camera.project(best.pose.target_in_camera_km)
    return Diagnosis(
        OTHER,
        f"another bright body is in the frame, at {masked_box(best)}: with it masked, "
        f"{scene.target.name} is found at ({x:.1f}, {y:.1f}).",
        "Mask the other body (--mask FILE), and give --start-offset where the search still takes it for the target.",
        best,
    )


def unmasked_diagnosis(best: Explanation, scene: Scene) -> Diagnosis:
    """The message of this cause."""
    x, y = scene.camera.project(best.pose.target_in_camera_km)
    return Diagnosis(
        Reason.TARGET_MASKED,
        f"the mask hides {scene.target.name}: without it, the disk is found at ({x:.1f}, {y:.1f}), "
        f"{disk_radius_px(best.pose, scene.camera, scene.target):.1f} px in radius.",
        "Give a mask that leaves disk and lit limb free: its non-zero pixels are not used.",
        best,
    )


def masked_box(best: Explanation) -> str:
    """Where the masked pixels of an explanation are, in words."""
    rows, columns = np.nonzero((best.candidate.observation.quality & np.uint16(Quality.MASKED_BY_USER)) != 0)
    return f"x {columns.min()}-{columns.max()}, y {rows.min()}-{rows.max()}"


def stray_light_diagnosis(best: Explanation, scene: Scene) -> Diagnosis:
    """The message of this cause."""
    x, y = scene.camera.project(best.pose.target_in_camera_km)
    return Diagnosis(
        STRAY,
        f"stray light slopes over the frame, by {best.candidate.detail:.4g} from its darkest to its brightest place: "
        f"with it subtracted, {scene.target.name} is found at ({x:.1f}, {y:.1f}).",
        "Give the picture with the stray light subtracted.",
        best,
    )


def blurred_diagnosis(best: Explanation, scene: Scene) -> Diagnosis:
    """The message of this cause."""
    width, camera = best.candidate.psf_px or 0.0, scene.psf_sigma_px
    return Diagnosis(
        Reason.IMAGE_BLURRED,
        "the picture is blurred, by motion, focus or an atmosphere: with a point spread of about "
        f"{width:.1f} px (sigma; the camera's is {camera:.2f}) outline and shading fit.",
        f"Give a sharper picture, or --camera FILE.toml with psf_sigma_px = {width:.1f}.",
        best,
    )


def smeared_diagnosis(best: Explanation) -> Diagnosis:
    """The message of this cause."""
    x, y = best.candidate.trail_px
    return Diagnosis(
        Reason.IMAGE_BLURRED,
        f"the picture is smeared by motion: with every point spread along a line of about {np.hypot(x, y):.0f} px, "
        f"{np.degrees(np.arctan2(y, x)) % 180:.0f} deg from +x towards +y, outline and shading fit.",
        "Give a picture with a shorter exposure, or one that follows the target.",
        best,
    )


def mirrored_diagnosis(best: Explanation) -> Diagnosis:
    """The message of this cause."""
    flip = best.candidate.flip or "x"
    return Diagnosis(
        Reason.IMAGE_MIRRORED,
        f"the picture is mirrored ({MEANINGS[flip].removeprefix('mirrored ')}): so mirrored, outline, shading and "
        "markings are the predicted ones.",
        f"Give --flip {flip}, or a camera file whose camera_from_instrument says how it is read out.",
        best,
    )


def rolled_diagnosis(best: Explanation) -> Diagnosis:
    """The message of this cause."""
    flip = f"Give --flip {best.candidate.flip}, or check" if best.candidate.flip else "Check"
    return Diagnosis(
        Reason.IMAGE_TURNED,
        f"the picture is turned: with the camera rolled by {best.candidate.detail:.0f} deg about its boresight (from "
        "+x towards +y), outline, shading and markings are the image's.",
        f"{flip} camera_from_j2000 (rows: +X sample, +Y line, +Z boresight) and the camera's camera_from_instrument.",
        best,
    )


def inverted_diagnosis(best: Explanation, scene: Scene) -> Diagnosis:
    """The message of this cause."""
    return Diagnosis(
        Reason.IMAGE_INVERTED,
        f"the picture is a negative: {scene.target.name} is darker than the sky, and as its negative it fits.",
        "Give the picture with brightness growing with light.",
        best,
    )


def sun_diagnosis(best: Explanation, predicted: Pose) -> Diagnosis:
    """The message of this cause."""
    here, there = sun_azimuth_deg(best.pose), sun_azimuth_deg(predicted)
    return Diagnosis(
        Reason.SUN_DIRECTION,
        f"the predicted direction of the Sun is not the image's: it is lit from about {here:.0f} deg in the picture "
        f"(from +x towards +y) at a phase angle of about {best.pose.phase_deg:.0f} deg, predicted are {there:.0f} and "
        f"{predicted.phase_deg:.0f} deg.",
        "Check sun_from_target_km, the time, and camera_from_j2000: a camera turned about its boresight looks so, "
        "and a mirrored picture (--flip).",
        best,
    )


def size_diagnosis(best: Explanation, predicted: Pose, scene: Scene, settings: DiagnoseSettings) -> Diagnosis:
    """The message of this cause."""
    size, focal_px = best.size, scene.camera.focal_length_px * best.size
    radius = disk_radius_px(predicted, scene.camera, scene.target)
    seen = (
        f"the disk in the image is {size:.3f} times as wide as predicted ({size * radius:.1f} px in radius, not "
        f"{radius:.1f})"
    )
    bodies = bodies_of_radius(max(scene.target.radii_km) * size, settings.bodies, scene.target.name)
    other = f", or --target {bodies[0]}" if len(bodies) == 1 else f", or another target ({', '.join(bodies)})"
    other = other if bodies else ""
    for factor, mode in ((0.5, "summed 2x2"), (0.25, "summed 4x4"), (2.0, "not summed")):
        if abs(size / factor - 1) <= settings.summed_size:
            return Diagnosis(
                Reason.SUMMING_MODE,
                f"{seen}: the frame is {mode}, or range, focal length or target are not the image's.",
                f"Give --camera FILE.toml with focal_length_px = {focal_px:.6g}{other}; it fits the image.",
                best,
            )
    return Diagnosis(
        Reason.DISK_SIZE,
        f"{seen}: the range, the focal length (camera, summing mode) or the target is not the image's.",
        f"A range of {predicted.range_km / size:.6g} km fits, or focal_length_px = {focal_px:.6g}{other}.",
        best,
    )


def bodies_of_radius(radius_km: float, tolerance: float, but: str) -> list[str]:
    """Targets of the catalog, at most four, whose largest radius is so large."""
    radii = {name: max(find_target(name).radii_km) for name in known_targets() if name != but}
    near = {name: abs(radius / radius_km - 1) for name, radius in radii.items()}
    return sorted((name for name in near if near[name] <= tolerance), key=lambda name: near[name])[:4]


def map_diagnosis(best: Explanation, scene: Scene) -> Diagnosis:
    """The message of this cause."""
    x, y = scene.camera.project(best.pose.target_in_camera_km)
    agreement = "" if best.markings is None else f" (they correlate by {best.markings:.2f})"
    return Diagnosis(
        MAP,
        f"the markings of the base map {scene.basemap.name} are not the image's{agreement}: without them, outline and "
        f"shading fit, with the centre at ({x:.1f}, {y:.1f}) and a range factor of {1 / best.size:.4f}.",
        "Clouds, another map or another face mislead; --map none leaves the markings out.",
        best,
    )
