"""Whether limb, brightness and shading of an image confirm its corrected pose: refused outright, doubted, or taken."""

import numpy as np

from catalog.errors import FailedError, PlanetposeError
from catalog.pose import IN_IMAGE, Pose
from catalog.reasons import Reason
from tasks.accept.settings import AcceptSettings
from tasks.fields import Json
from tasks.ingest.pose_step import PredictedPose
from tasks.validate.limb import LimbFigures
from tasks.validate.step import OrientationReport, ValidateResult
from tasks.validate.sun import SunReport

BEHIND = Reason.TARGET_BEHIND_CAMERA
SUN_SIGMAS = 4.0
# A close-up's limb may lie so many sigmas of the base map's place off.
LIMB_SIGMAS = 2.0
# Sources of a position that may have been made from the picture itself, by the size of its disk.
ASSUMED = ("file", IN_IMAGE)
# A limb cannot show a narrower PSF than this.
LEAST_PSF_PX = 0.5
BEHIND_REMEDY = (
    "Check camera_from_j2000 (rows: +X sample, +Y line, +Z boresight) and the sign of target_from_spacecraft_km."
)


def check_report(accept: AcceptSettings, report: ValidateResult) -> None:
    """Raise FailedError when the image does not confirm the corrected pose, see `check_limb`."""
    if report.patches is None:
        check_limb(accept, report.limb)
    else:
        check_limb(allowing(accept, report.patches), report.limb, by_patches=True)


def allowing(accept: AcceptSettings, patches: Json) -> AcceptSettings:
    """The same for a close-up: where its limb is, is not better known than its map."""
    known_px = LIMB_SIGMAS * float(patches["sigma_map_px"]) * float(patches["map_pixel_px"])
    limits = {name: getattr(accept, name) for name in ("max_limb_rms_px", "sure_limb_rms_px")}
    return accept.model_copy(update={name: limit and max(limit, known_px) for name, limit in limits.items()})


def check_limb(accept: AcceptSettings, limb: LimbFigures, by_patches: bool = False) -> None:
    """Raise FailedError when limb and brightness of the image do not confirm the corrected pose. by_patches: patches
    of the base map confirm it, so that no limb is needed, and the whole disk's brightness says nothing."""
    points, likeness = limb.points, limb.likeness
    if likeness < accept.min_likeness and not by_patches:
        raise FailedError(
            Reason.IMAGE_UNLIKE_SIMULATION,
            f"inside the disk and around it, image and simulation of the corrected pose correlate by {likeness:.2f} "
            f"(needed {accept.min_likeness:g}).",
            "Check the picture, camera, target and Sun direction; accept.min_likeness of the profile is the limit.",
        )
    if limb.robust_px is None and accept.require_limb and not by_patches:
        measured = f"only {points} segments of the lit limb could be measured"
        if limb.tried == 0:
            measured = "the lit limb is nowhere on usable pixels of the frame"
        raise FailedError(
            Reason.LIMB_NOT_MEASURED,
            f"{measured}, so nothing confirms the corrected pose.",
            "Check the picture; a profile with accept.require_limb = false publishes it all the same.",
        )
    if is_off(accept, limb, accept.max_limb_rms_px):
        raise FailedError(
            Reason.LIMB_DOES_NOT_FIT,
            f"the corrected limb is {off_in_words(limb)} from the image's, allowed {accept.max_limb_rms_px:g} px.",
            "Check camera, target and range; accept.max_limb_rms_px of the profile is the limit.",
        )


def is_about_orientation(orientation: OrientationReport) -> bool:
    """Whether the product's own orientation was judged: what the flow found of an earlier one is then out of date."""
    return orientation.verdict in ("matched", "mismatched")


def doubtful_likeness(accept: AcceptSettings, limb: LimbFigures) -> str | None:
    """The doubt that a poor likeness of image and simulation raises."""
    likeness = limb.likeness
    if likeness >= accept.sure_likeness:
        return None
    return (
        f"{Reason.IMAGE_UNLIKE_SIMULATION}: image and simulation correlate by only {likeness:.2f} (sure from "
        f"{accept.sure_likeness:g}). Check Sun direction, base map and the picture."
    )


def doubtful_limb(accept: AcceptSettings, limb: LimbFigures) -> str | None:
    """The doubt that a limb raises which lies elsewhere in the image than the corrected pose has it."""
    if not is_off(accept, limb, accept.sure_limb_rms_px):
        return None
    return (
        f"{Reason.LIMB_DISAGREES}: markings and brightness put the limb {off_in_words(limb)} from where the image "
        f"shows it (sure to {accept.sure_limb_rms_px:g} px). Check the base map and the picture; --profile standard "
        "trusts the limb alone."
    )


def doubtful_target(accept: AcceptSettings, report: ValidateResult, predicted: PredictedPose) -> str | None:
    """The doubt that the image is of another body, where nothing tells that it is the target: no markings match, and
    how far it is was not known beforehand."""
    source, errors = predicted.sources["target_from_spacecraft_km"], predicted.errors
    by_markings = report.patches is not None or report.orientation.verdict in ("matched", "mismatched")
    if by_markings or (report.orientation.sigmas or 0.0) >= accept.sure_markings or source not in ASSUMED:
        return None
    scales = {"range_km": predicted.pose.range_km, "range_share": 1.0}
    stated = [errors[name] / scale for name, scale in scales.items() if name in errors]
    if stated and float(np.hypot.reduce(stated)) <= accept.sure_range:
        return None
    return (
        f"{Reason.TARGET_NOT_CONFIRMED}: no markings of a base map show that the body is the target, and its range is "
        f"from a pose file that states no error of it (or more than {accept.sure_range:.0%}), or was found in the "
        "image: another body as round, at the range at which it is as wide, looks the same. Give kernels, or the "
        "range's error in the pose file (errors.range_km)."
    )


def doubtful_sun(accept: AcceptSettings, sun: SunReport) -> str | None:
    """The doubt that a terminator and a shading raise which are not those of the metadata's Sun."""
    if sun.across_deg is None or sun.phase_deg is None:
        return None
    across = contradicts(sun.across_deg, sun.across_sigma_deg, accept.sun_across_deg)
    if not across and not contradicts(sun.phase_deg, sun.phase_sigma_deg, accept.sun_phase_deg):
        return None
    return (
        f"{Reason.SUN_DIRECTION_DISAGREES}: shading and terminator put the Sun {sun.azimuth_deg:+.0f} deg (1-sigma "
        f"{sun.azimuth_sigma_deg:.1f}) about the line of sight, from +x towards +y, and {sun.phase_deg:+.0f} deg "
        f"({sun.phase_sigma_deg:.1f}) of phase from where the metadata have it. Check sun_from_target_km, the "
        "camera's roll, and whether the picture is flipped."
    )


def contradicts(off_deg: float, sigma_deg: float | None, least_deg: float | None) -> bool:
    """Whether the Sun is off by more than `least_deg` and by more than its error allows."""
    return least_deg is not None and abs(off_deg) > max(least_deg, SUN_SIGMAS * (sigma_deg or 0.0))


def doubtful_blur(accept: AcceptSettings, limb: LimbFigures) -> str | None:
    """What a blur explains of other doubts: alone it is none, for a camera file may have a sharper one."""
    blur = limb.blur
    if blur is None or blur <= accept.sure_blur:
        return None
    return (
        f"{Reason.IMAGE_BLURRED}: "
        f"the limb in the image is {blur:.1f} times as wide as simulated: the picture is blurred, by "
        "motion, focus or an atmosphere, or the camera's psf_sigma_px is too small. Check picture and camera file."
    )


def doubtful_psf(accept: AcceptSettings, solved_px: float | None, limb: LimbFigures) -> str | None:
    """The doubt that a solution raises whose PSF, of 1-sigma `solved_px`, is much wider than the image's own limb: it
    has blurred what its simulation gets wrong, shading, markings or the Sun."""
    shown = limb.psf_sigma_px
    if solved_px is None or shown is None or solved_px <= accept.sure_psf * max(shown, LEAST_PSF_PX):
        return None
    return (
        f"{Reason.PSF_DISAGREES}: markings and brightness are fitted best with a PSF of {solved_px:.1f} px (1-sigma), "
        f"and the limb in the image is as sharp as by one of {shown:.1f} px. Check base map, Sun direction and "
        "orientation."
    )


def doubtful_blocks(accept: AcceptSettings, blocks: float | None) -> str | None:
    """What the blocks of a compression explain of other doubts. blocks: see `blocks_of`."""
    if blocks is None or blocks <= accept.sure_blocks:
        return None
    return (
        f"{Reason.COMPRESSION_BLOCKS}: "
        f"the picture shows the blocks of a strong compression (steps {blocks:.1f} times as large "
        "at their edges as elsewhere). Take a version with less compression."
    )


def is_off(accept: AcceptSettings, limb: LimbFigures, limit_px: float | None) -> bool:
    """Whether the limb as a whole lies farther off than `limit_px`, or more than accept.limb_share of it so far off
    that all of it together does."""
    if limit_px is None or limb.robust_px is None:
        return False
    on_an_arc = (limb.disagreeing or 0.0) > accept.limb_share and (limb.normal_rms_px or 0.0) > limit_px
    return bool(limb.robust_px > limit_px or on_an_arc)


def off_in_words(limb: LimbFigures) -> str:
    """How far off a limb is."""
    return f"{limb.robust_px:.2f} px (robust RMS; {limb.disagreeing:.0%} of its segments disagree)"


def explained(error: PlanetposeError, predicted: Pose) -> PlanetposeError:
    """The failure of a correction; when the predicted pose has the target behind the camera, with that as the
    reason: turned to the target by the shortest way, a camera may stand on its head, and what fails then misleads."""
    if error.code in (BEHIND, "interrupted") or not is_behind(predicted):
        return error
    fault = f"{behind(predicted)}. With the camera turned towards it the correction fails: {error.fault}"
    return type(error)(BEHIND, fault, BEHIND_REMEDY)


def refuse_doubtful_behind(predicted: Pose, doubts: list[str]) -> None:
    """Raise FailedError where something speaks against a corrected pose whose predicted one looks away from the
    target: nothing then tells which way up the camera was."""
    if doubts and is_behind(predicted):
        first, others = doubts[0].partition(". ")[0], len(doubts) - 1
        more = f" and {others} more {'doubt' if others == 1 else 'doubts'}" if others else ""
        fault = f"{behind(predicted)}. With the camera turned towards it the result is doubtful ({first}{more})."
        raise FailedError(BEHIND, fault, BEHIND_REMEDY)


def is_behind(predicted: Pose) -> bool:
    """Whether a predicted pose has the target behind the camera."""
    return bool(predicted.target_in_camera_km[2] <= 0)


def behind(predicted: Pose) -> str:
    """How far behind the camera a predicted pose has the target, in words."""
    along = predicted.target_in_camera_km[2] / predicted.range_km
    off_deg = float(np.degrees(np.arccos(np.clip(along, -1, 1))))
    return f"the predicted pose has the target behind the camera, {off_deg:.0f} deg from its boresight"
