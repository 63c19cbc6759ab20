"""What was corrected in all, from the predicted pose to the last one."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from catalog.camera import Camera
from catalog.pose import Pose
from catalog.rotation import vector_deg_from_rotation
from tasks.plain import plain

KINDS = ("offset_px", "range_factor", "attitude_deg", "roll_deg", "range_factor_free", "psf_sigma_px")
LAST = ("range_factor_free", "psf_sigma_px")
Corrections = Mapping[str, Mapping[str, Any]]


def summary(before: Pose, after: Pose, camera: Camera, corrections: Corrections) -> dict[str, Any]:
    """The whole correction and its 1-sigma, as plain JSON.

    centre_px: target's centre under the corrected pose, undistorted frame. offset_px: that minus the predicted centre
    (None when the predicted target is behind the camera). range_factor: corrected by predicted distance. attitude_deg:
    rotation vector of the body's turn, in its own frame; None when no step could determine it. roll_deg: how far the
    camera was turned about the line of sight, from +x towards +y of the picture; None when no step looked for it or
    could tell. range_factor_free: the range factor that the image alone gives, psf_sigma_px: the blur it shows;
    None unless the joint step was done. corrections: results of the steps `point-1`, `range-1` ... in the order of
    doing; the last one of a kind gives the uncertainty.
    """
    centre, predicted = (camera.project(pose.target_in_camera_km) for pose in (after, before))
    sigma = {key: last_uncertainty(corrections, key) for key in KINDS}
    # The body frame after is R^T times the one before, R the turn of the body in its own frame.
    turn = vector_deg_from_rotation((after.body_from_j2000 @ before.body_from_j2000.T).T)
    offset = centre - predicted
    return {
        "centre_px": plain(centre),
        "offset_px": plain(offset) if np.isfinite(offset).all() else None,
        "range_factor": after.range_km / before.range_km,
        "attitude_deg": plain(turn) if determined(corrections, "attitude_deg") else None,
        "roll_deg": rolled_deg(corrections),
        **{key: last_change(corrections, key) for key in LAST},
        "uncertainty": {"centre_px": sigma["offset_px"], **sigma},
        "pose": after.to_dict(),
    }


def calibrated(corrections: Corrections) -> dict[str, Mapping[str, Any]]:
    """The corrections as they may be stated: without the attitude's error of steps that take the disk's place for known
    (those that state no offset themselves) where no step states how well it is."""
    stated = [result["uncertainty"] for result in corrections.values()]
    ranged = any(result["changed"].get("range_factor") is not None for result in corrections.values())
    needed = ("offset_px", "range_factor") if ranged else ("offset_px",)
    if all(any(sigma.get(key) is not None for sigma in stated) for key in needed):
        return dict(corrections)
    return {
        name: {**result, "uncertainty": {**result["uncertainty"], "attitude_deg": None}}
        if result["uncertainty"].get("attitude_deg") is not None and result["uncertainty"].get("offset_px") is None
        else result
        for name, result in corrections.items()
    }


def rolled_deg(corrections: Corrections) -> float | None:
    """All rolls of the camera together, None when no step determined one."""
    rolls = [result["changed"].get("roll_deg") for result in corrections.values()]
    known = [float(roll) for roll in rolls if roll is not None]
    return sum(known) if known else None


def last_change(corrections: Corrections, key: str) -> Any:
    """What the last step that changed `key` says, or None."""
    found = [result["changed"].get(key) for result in corrections.values()]
    return next((value for value in reversed(found) if value is not None), None)


def determined(corrections: Corrections, key: str) -> bool:
    """Whether some step found a value for `key`."""
    return any(result["changed"].get(key) is not None for result in corrections.values())


def last_uncertainty(corrections: Corrections, key: str) -> Any:
    """The uncertainty that the last step that determined `key` gives."""
    found = [result["uncertainty"].get(key) for result in corrections.values() if key in result["uncertainty"]]
    return next((value for value in reversed(found) if value is not None), None)
