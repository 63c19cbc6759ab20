"""The adjustment in plain words: cameras, sequences, images."""

from collections.abc import Sequence
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
from tasks.joint.parameters import RANGE, ROLL
from tasks.plain import plain


def adjusted_poses(images: Sequence[Measurement], adjustment: Adjustment) -> list[Pose]:
    """Each image's pose by what it shares with the others: the sequence's range bias, roll and attitude, its centre
    moved along. The camera's focal scale is no part of a pose."""
    bias = {
        i: float(adjustment.theta[adjustment.of_sequence(number)][0])
        for number, positions in enumerate(adjustment.sequences)
        for i in positions
    }
    return [image.state_with(adjustment.shared[i], bias[i]).pose for i, image in enumerate(images)]


def report_of(images: Sequence[Measurement], adjustment: Adjustment, settings: AdjustSettings) -> dict[str, Any]:
    """Everything that was found, as plain JSON."""
    from scipy.stats import chi2

    factors = mean_factors(images)
    return {
        "images": image_rows(images, adjustment),
        "cameras": camera_rows(images, adjustment),
        "sequences": sequence_rows(images, adjustment, settings),
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
            "probability": float(chi2.sf(adjustment.chi_square, adjustment.degrees)) if adjustment.degrees else None,
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
    images: Sequence[Measurement], adjustment: Adjustment, settings: AdjustSettings
) -> list[dict[str, Any]]:
    """Range bias and turn of the target of every sequence, and how well its images agree."""
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
            }
        )
    return rows


def image_rows(images: Sequence[Measurement], adjustment: Adjustment) -> list[dict[str, Any]]:
    """Every image before and after, relative to its prediction; errors 1-sigma."""
    number_of = {i: number for number, positions in enumerate(adjustment.sequences) for i in positions}
    poses = adjusted_poses(images, adjustment)
    rows = []
    for i, image in enumerate(images):
        sigma = np.sqrt(np.diag(adjustment.shared_covariance[i]))
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
                "pose": poses[i].to_dict(),
            }
        )
    return rows


def turn_between(before: Pose, after: Pose) -> NDArray[np.float64]:
    """Rotation vector (3,), degrees, of the body's turn, in its own frame."""
    return np.asarray(vector_deg_from_rotation((after.body_from_j2000 @ before.body_from_j2000.T).T))
