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
PUBLISHED = ("ok", "doubtful")


def believe(accept: AcceptSettings, report: dict[str, Any]) -> None:
    """Raise FailedError when limb and brightness of the image do not bear the corrected pose out."""
    limb = report["limb"]
    rms_px, points, likeness = limb["rms_px"], limb["points"], limb["likeness"]
    if likeness < accept.min_likeness:
        raise FailedError(
            "image-unlike-simulation",
            f"inside the disk and around it, image and simulation of the corrected pose correlate by {likeness:.2f} "
            f"(needed {accept.min_likeness:g}).",
            "Check the picture, camera, target and Sun direction; accept.min_likeness of the profile is the limit.",
        )
    if rms_px is None and accept.require_limb:
        measured = f"only {points} segments of the lit limb could be measured"
        if limb["tried"] == 0:
            measured = "the lit limb is nowhere on usable pixels of the frame"
        raise FailedError(
            "limb-not-measured",
            f"{measured}, so nothing bears the corrected pose out.",
            "Check the picture; a profile with accept.require_limb = false publishes it all the same.",
        )
    if rms_px is not None and accept.max_limb_rms_px is not None and rms_px > accept.max_limb_rms_px:
        raise FailedError(
            "limb-does-not-fit",
            f"the corrected limb is {rms_px:.2f} px (RMS) from the image's, allowed {accept.max_limb_rms_px:g} px.",
            "Check camera, target and range; accept.max_limb_rms_px of the profile is the limit.",
        )


def doubts(chain: Chain) -> list[str]:
    """Why the corrected pose is doubtful, each as `code: fault. Remedy.`; empty when nothing speaks against it.

    A correction doubts by a text under `doubt` in its evidence; only the last one of a kind is asked.
    """
    last = {name.partition("-")[0]: record.result for name, record in chain.records.items()}
    superseded = {"attitude"} if is_about_orientation(last) else set()
    found = [result.get("evidence", {}).get("doubt") for kind, result in last.items() if kind not in superseded]
    if "validate" in last:
        accept, report = chain.request.profile.accept, last["validate"]
        found += [doubtful_likeness(accept, report), doubtful_limb(accept, report)]
        found += [doubtful_sun(accept, report), report.get("doubt")]
    return [doubt for doubt in found if doubt]


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
    rms_px, sure_px = report["limb"]["rms_px"], accept.sure_limb_rms_px
    if rms_px is None or sure_px is None or rms_px <= sure_px:
        return None
    return (
        f"limb-disagrees: markings and brightness put the limb {rms_px:.2f} px (RMS) from where the image shows it "
        f"(sure to {sure_px:g} px). Check the base map and the picture; --profile standard trusts the limb alone."
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


def explained(error: PlanetposeError, predicted: dict[str, Any]) -> PlanetposeError:
    """The failure of a correction; when the predicted pose (plain) has the target behind the camera, with that as the
    reason: turned to the target by the shortest way, a camera may stand on its head, and what fails then misleads."""
    pose = Pose.from_dict(predicted)
    off_deg = float(np.degrees(np.arccos(np.clip(pose.target_in_camera_km[2] / pose.range_km, -1, 1))))
    if off_deg < 90 or error.code in (BEHIND, "interrupted"):
        return error
    return type(error)(
        BEHIND,
        f"the predicted pose has the target behind the camera, {off_deg:.0f} deg from its boresight; with the camera "
        f"turned to it, {error.fault}",
        "Check camera_from_j2000 (rows: +X sample, +Y line, +Z boresight) and the sign of target_from_spacecraft_km.",
    )


def reminded(error: PlanetposeError, overruled: list[str]) -> PlanetposeError:
    """The failure of an image whose label says otherwise than the user: what fails then mostly misleads."""
    if not overruled or error.code == "interrupted":
        return error
    return type(error)(error.code, error.fault, f"{reminder(overruled)}{error.remedy}".strip())
