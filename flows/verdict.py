"""What is believed of a corrected pose: refused outright, doubted, or taken."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from catalog.errors import FailedError, PlanetposeError
from catalog.pose import Pose
from catalog.readers.overruled import reminder
from flows.chain import Chain
from flows.profile import AcceptSettings

BEHIND = "target-behind-camera"
SUN_SIGMAS = 4.0
BEHIND_REMEDY = (
    "Check camera_from_j2000 (rows: +X sample, +Y line, +Z boresight) and the sign of target_from_spacecraft_km."
)
PUBLISHED = ("ok", "doubtful")


def believe(accept: AcceptSettings, report: dict[str, Any]) -> None:
    """Raise FailedError when limb and brightness of the image do not bear the corrected pose out."""
    limb = report["limb"]
    points, likeness = limb["points"], limb["likeness"]
    if likeness < accept.min_likeness:
        raise FailedError(
            "image-unlike-simulation",
            f"inside the disk and around it, image and simulation of the corrected pose correlate by {likeness:.2f} "
            f"(needed {accept.min_likeness:g}).",
            "Check the picture, camera, target and Sun direction; accept.min_likeness of the profile is the limit.",
        )
    if limb["robust_px"] is None and accept.require_limb:
        measured = f"only {points} segments of the lit limb could be measured"
        if limb["tried"] == 0:
            measured = "the lit limb is nowhere on usable pixels of the frame"
        raise FailedError(
            "limb-not-measured",
            f"{measured}, so nothing bears the corrected pose out.",
            "Check the picture; a profile with accept.require_limb = false publishes it all the same.",
        )
    if is_off(accept, limb, accept.max_limb_rms_px):
        raise FailedError(
            "limb-does-not-fit",
            f"the corrected limb is {off_in_words(limb)} from the image's, allowed {accept.max_limb_rms_px:g} px.",
            "Check camera, target and range; accept.max_limb_rms_px of the profile is the limit.",
        )


def doubts(chain: Chain) -> list[str]:
    """Why the corrected pose is doubtful, each as `code: fault. Remedy.`; empty when nothing speaks against it.

    A correction doubts by a text under `doubt` in its evidence; only the last one of a kind is asked.
    """
    last = {name.partition("-")[0]: record.result for name, record in chain.records.items()}
    superseded = {"attitude"} if is_about_orientation(last) else set()
    found = [result.get("evidence", {}).get("doubt") for kind, result in last.items() if kind not in superseded]
    accept = chain.request.profile.accept
    if "validate" in last:
        report = last["validate"]
        found += [doubtful_likeness(accept, report), doubtful_limb(accept, report)]
        found += [doubtful_sun(accept, report), report.get("doubt")]
    found = [doubt for doubt in found if doubt]
    if found and "validate" in last:
        spoilt = [doubtful_blocks(accept, last["validate"]), doubtful_blur(accept, last["validate"])]
        found = [doubt for doubt in spoilt if doubt] + found
    return found


def is_about_orientation(last: Mapping[str, Any]) -> bool:
    """Whether the product's own orientation was judged: what the flow found of an earlier one is then out of date."""
    orientation = last.get("validate", {}).get("orientation") or {}
    return orientation.get("verdict") in ("matched", "mismatched")


def doubtful_likeness(accept: AcceptSettings, report: dict[str, Any]) -> str | None:
    """The doubt that a poor likeness of image and simulation raises."""
    likeness = report["limb"]["likeness"]
    if likeness >= accept.sure_likeness:
        return None
    return (
        f"image-unlike-simulation: image and simulation correlate by only {likeness:.2f} (sure from "
        f"{accept.sure_likeness:g}). Check Sun direction, base map and the picture."
    )


def doubtful_limb(accept: AcceptSettings, report: dict[str, Any]) -> str | None:
    """The doubt that a limb raises which lies elsewhere in the image than the corrected pose has it."""
    if not is_off(accept, report["limb"], accept.sure_limb_rms_px):
        return None
    return (
        f"limb-disagrees: markings and brightness put the limb {off_in_words(report['limb'])} from where the image "
        f"shows it (sure to {accept.sure_limb_rms_px:g} px). Check the base map and the picture; --profile standard "
        "trusts the limb alone."
    )


def doubtful_sun(accept: AcceptSettings, report: dict[str, Any]) -> str | None:
    """The doubt that a terminator and a shading raise which are not those of the metadata's Sun."""
    sun = report.get("sun") or {}
    if sun.get("across_deg") is None:
        return None

    def contradicts(name: str, least_deg: float | None) -> bool:
        off_deg = abs(sun[f"{name}_deg"])
        return least_deg is not None and off_deg > max(least_deg, SUN_SIGMAS * sun[f"{name}_sigma_deg"])

    if not contradicts("across", accept.sun_across_deg) and not contradicts("phase", accept.sun_phase_deg):
        return None
    return (
        f"sun-direction-disagrees: shading and terminator put the Sun {sun['azimuth_deg']:+.0f} deg (1-sigma "
        f"{sun['azimuth_sigma_deg']:.1f}) about the line of sight, from +x towards +y, and {sun['phase_deg']:+.0f} deg "
        f"({sun['phase_sigma_deg']:.1f}) of phase from where the metadata have it. Check sun_from_target_km, the "
        "camera's roll, and whether the picture is flipped."
    )


def doubtful_blur(accept: AcceptSettings, report: dict[str, Any]) -> str | None:
    """What a blur explains of other doubts: alone it is none, for a camera file may have a sharper one."""
    blur = report["limb"].get("blur")
    if blur is None or blur <= accept.sure_blur:
        return None
    return (
        f"image-blurred: the limb in the image is {blur:.1f} times as wide as simulated: the picture is blurred, by "
        "motion, focus or an atmosphere, or the camera's psf_sigma_px is too small. Check picture and camera file."
    )


def doubtful_blocks(accept: AcceptSettings, report: dict[str, Any]) -> str | None:
    """What the blocks of a compression explain of other doubts."""
    blocks = report.get("blocks")
    if blocks is None or blocks <= accept.sure_blocks:
        return None
    return (
        f"compression-blocks: the picture shows the blocks of a strong compression (steps {blocks:.1f} times as large "
        "at their edges as elsewhere). Take a version with less compression."
    )


def is_off(accept: AcceptSettings, limb: dict[str, Any], limit_px: float | None) -> bool:
    """Whether the limb as a whole lies farther off than `limit_px`, or more than accept.limb_share of it so far off
    that all of it together does."""
    if limit_px is None or limb["robust_px"] is None:
        return False
    on_an_arc = limb["disagreeing"] > accept.limb_share and limb["normal_rms_px"] > limit_px
    return bool(limb["robust_px"] > limit_px or on_an_arc)


def off_in_words(limb: dict[str, Any]) -> str:
    """How far off a limb is."""
    return f"{limb['robust_px']:.2f} px (robust RMS; {limb['disagreeing']:.0%} of its segments disagree)"


def explained(error: PlanetposeError, predicted: dict[str, Any]) -> PlanetposeError:
    """The failure of a correction; when the predicted pose (plain) has the target behind the camera, with that as the
    reason: turned to the target by the shortest way, a camera may stand on its head, and what fails then misleads."""
    if error.code in (BEHIND, "interrupted") or not is_behind(predicted):
        return error
    return type(error)(BEHIND, f"{behind(predicted)}; with the camera turned to it, {error.fault}", BEHIND_REMEDY)


def refuse_doubtful_behind(predicted: dict[str, Any], doubts: list[str]) -> None:
    """Raise FailedError where something speaks against a corrected pose whose predicted one (plain) looks away from the
    target: nothing then tells which way up the camera was."""
    if doubts and is_behind(predicted):
        told = "; ".join(doubt.partition(". ")[0] for doubt in doubts)
        raise FailedError(BEHIND, f"{behind(predicted)}; with the camera turned to it, {told}.", BEHIND_REMEDY)


def is_behind(predicted: dict[str, Any]) -> bool:
    """Whether a predicted pose (plain) has the target behind the camera."""
    return bool(Pose.from_dict(predicted).target_in_camera_km[2] <= 0)


def behind(predicted: dict[str, Any]) -> str:
    """How far behind the camera a predicted pose (plain) has the target, in words."""
    pose = Pose.from_dict(predicted)
    off_deg = float(np.degrees(np.arccos(np.clip(pose.target_in_camera_km[2] / pose.range_km, -1, 1))))
    return f"the predicted pose has the target behind the camera, {off_deg:.0f} deg from its boresight"


def reminded(error: PlanetposeError, overruled: list[str]) -> PlanetposeError:
    """The failure of an image whose label says otherwise than the user: what fails then mostly misleads."""
    if not overruled or error.code == "interrupted":
        return error
    return type(error)(error.code, error.fault, f"{reminder(overruled)}{error.remedy}".strip())
