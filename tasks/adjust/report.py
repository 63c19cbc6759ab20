"""The adjustment in plain words: cameras, sequences, images."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from catalog.rotation import vector_deg_from_rotation
from tasks.adjust.factors import mean_factors, survives
from tasks.adjust.likelihood import KINDS
from tasks.adjust.measurement import Measurement
from tasks.adjust.settings import AdjustSettings
from tasks.adjust.solve import AT_ATTITUDE, AT_RANGE, AT_ROLL, Adjustment
from tasks.adjust.target_offset import TargetOffset, camera_sigma_px, pose_with_target, target_offsets
from tasks.joint.parameters import RANGE, ROLL
from tasks.plain import plain
from tasks.stars.separate import TOGETHER

BY_STARS, BY_TARGET, NOT_APART = "stars", "target", None
WITHOUT_STARS = f"{TOGETHER}: no image of the sequence was corrected with stars (`--stars`)"


@dataclass(frozen=True)
class Adjusted:
    """Poses of all images by what they share; offsets: of every sequence's target, None where no image has stars."""

    poses: list[Pose]
    offsets: list[TargetOffset | None]


def adjusted(images: Sequence[Measurement], adjustment: Adjustment) -> Adjusted:
    """Each image's pose by what it shares with the others: the sequence's range bias, roll and attitude, its centre
    moved along, and where there are stars the target's offset, the camera following. The camera's focal scale is no
    part of a pose."""
    poses = [image.predicted for image in images]
    for number, positions in enumerate(adjustment.sequences):
        bias = float(adjustment.theta[adjustment.of_sequence(number)][0])
        for i in positions:
            poses[i] = images[i].state_with(adjustment.shared[i], bias).pose
    offsets = target_offsets(images, poses, adjustment)
    for positions, offset in zip(adjustment.sequences, offsets, strict=True):
        for i in positions:
            poses[i] = poses[i] if offset is None else pose_with_target(images[i], poses[i], offset)
    return Adjusted(poses, offsets)


def report_of(
    images: Sequence[Measurement], adjustment: Adjustment, found: Adjusted, settings: AdjustSettings
) -> dict[str, Any]:
    """Everything that was found, as plain JSON."""
    factors = mean_factors(images)
    return {
        "images": image_rows(images, adjustment, found),
        "cameras": camera_rows(images, adjustment),
        "sequences": sequence_rows(images, adjustment, found, settings),
        "ties": [
            {
                "kind": kind,
                "chi_square": float(adjustment.by_kind[number]),
                "measurements": int(adjustment.counts[number]),
                "scatter": float(adjustment.scatter[number]),
                "holds": bool(adjustment.scatter[number] == 0),
            }
            for number, kind in enumerate(KINDS)
        ],
        "consistency": {
            "chi_square": adjustment.chi_square,
            "degrees_of_freedom": adjustment.degrees,
            "probability": probability_of(adjustment.chi_square, adjustment.degrees),
        },
        "range_factors": [
            {
                "camera": factor.camera,
                "mean": factor.mean,
                "sigma": factor.sigma,
                "scatter": factor.scatter,
                "images": factor.count,
                "verdict": factor.verdict,
            }
            for factor in factors
        ],
        "overestimated_distance": survives(factors),
        "settings": settings.model_dump(mode="json"),
    }


def camera_rows(images: Sequence[Measurement], adjustment: Adjustment) -> list[dict[str, Any]]:
    """Constants of the cameras. focal_scale: true over catalog's focal length; psf_factor: true over assumed blur."""
    rows = []
    for number, name in enumerate(adjustment.cameras):
        place = adjustment.of_camera(number)
        focal, roll, psf = adjustment.theta[place]
        sigma = np.sqrt(np.diag(adjustment.covariance)[place])
        assumed = next(image.psf_sigma_px for image in images if image.camera.name == name)
        rows.append(
            {
                "camera": name,
                "images": sum(image.camera.name == name for image in images),
                "focal_scale": float(np.exp(focal)),
                "focal_scale_sigma": float(sigma[0]),
                "roll_deg": float(roll),
                "roll_sigma_deg": float(sigma[1]),
                "psf_sigma_px": float(assumed * np.exp(psf)),
                "psf_sigma_px_sigma": float(assumed * np.exp(psf) * sigma[2]),
            }
        )
    return rows


def sequence_rows(
    images: Sequence[Measurement], adjustment: Adjustment, found: Adjusted, settings: AdjustSettings
) -> list[dict[str, Any]]:
    """Range bias, turn and offset of the target of every sequence, and how well its images agree."""
    rows = []
    for number, positions in enumerate(adjustment.sequences):
        place = adjustment.of_sequence(number)
        bias, *turn = adjustment.theta[place]
        sigma = np.sqrt(np.diag(adjustment.covariance)[place])
        first = images[positions[0]]
        rows.append(
            {
                "sequence": number,
                "camera": first.camera.name,
                "target": first.target.name,
                "images": [images[i].product for i in positions],
                "range_factor": float(np.exp(bias)),
                "range_factor_sigma": float(sigma[0]),
                "attitude_deg": plain(np.array(turn)),
                "attitude_sigma_deg": plain(np.hypot(sigma[1:], settings.map_deg)),
                "attitude_about": "rotation model of the catalog" if first.target.rotation else "predicted attitude",
                "chi_square": float(adjustment.own[positions].sum()),
                "measurements": int(adjustment.ranks[positions].sum()),
                "target_offset": offset_row(images, found.offsets[number]),
            }
        )
    return rows


def offset_row(images: Sequence[Measurement], offset: TargetOffset | None) -> dict[str, Any]:
    """Where the target of a sequence is, from where ephemeris and trajectory have it; `reason` says why that is not
    known. residual_px: of each image with stars about it."""
    if offset is None:
        return {"offset_km": None, "reason": WITHOUT_STARS}
    return {
        "offset_km": plain(offset.offset_km),
        "covariance_km2": plain(offset.covariance_km2),
        "sigma_km": plain(np.sqrt(np.diag(offset.covariance_km2))),
        "images_with_stars": [images[i].product for i in offset.images],
        "residual_px": plain(offset.residual_px),
        "chi_square": offset.chi_square,
        "degrees_of_freedom": offset.degrees,
        "probability": probability_of(offset.chi_square, offset.degrees),
        "reason": None,
    }


def probability_of(chi_square: float, degrees: int) -> float | None:
    """Of a chi-square that is as large or larger; None without degrees of freedom."""
    from scipy.stats import chi2

    return float(chi2.sf(chi_square, degrees)) if degrees > 0 else None


def image_rows(images: Sequence[Measurement], adjustment: Adjustment, found: Adjusted) -> list[dict[str, Any]]:
    """Every image before and after, relative to its prediction; errors 1-sigma. camera_by: what tells the camera from
    the target: the image's own stars, the target that stars of other images of the sequence place, or nothing."""
    number_of = {i: number for number, positions in enumerate(adjustment.sequences) for i in positions}
    poses = found.poses
    rows = []
    for i, image in enumerate(images):
        sigma = np.sqrt(np.diag(adjustment.shared_covariance[i]))
        offset = found.offsets[number_of[i]]
        bias = adjustment.covariance[adjustment.of_sequence(number_of[i])][:, adjustment.of_sequence(number_of[i])]
        rows.append(
            {
                "product": image.product,
                "camera": image.camera.name,
                "sequence": number_of[i],
                "weight": float(adjustment.weights[i]),
                "chi_square": float(adjustment.own[i]),
                "range_factor_free": float(np.exp(image.step[RANGE])),
                "range_factor_free_sigma": float(np.sqrt(image.covariance[RANGE, RANGE])),
                "roll_deg_before": float(image.step[ROLL]),
                "range_factor": poses[i].range_km / image.predicted.range_km,
                "range_factor_sigma": float(np.sqrt(bias[0, 0])),
                "apparent_range_factor": float(np.exp(adjustment.shared[i][AT_RANGE])),
                "apparent_range_factor_sigma": float(sigma[AT_RANGE]),
                "roll_deg": float(adjustment.shared[i][AT_ROLL]),
                "roll_sigma_deg": float(sigma[AT_ROLL]),
                "attitude_deg": plain(turn_between(image.predicted, poses[i])),
                "attitude_sigma_deg": plain(sigma[AT_ATTITUDE]),
                "camera_by": NOT_APART if offset is None else BY_STARS if image.stars is not None else BY_TARGET,
                "camera_sigma_px": plain(camera_sigma_px(image, offset)),
                "pose": poses[i].to_dict(),
            }
        )
    return rows


def turn_between(before: Pose, after: Pose) -> NDArray[np.float64]:
    """Rotation vector (3,), degrees, of the body's turn, in its own frame."""
    return np.asarray(vector_deg_from_rotation((after.body_from_j2000 @ before.body_from_j2000.T).T))
