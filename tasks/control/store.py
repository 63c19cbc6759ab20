"""Control of a store: ties and bundle of its images, and what is written of them."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera_constants import FOCAL_LENGTH
from catalog.errors import FailedError, RefusedError
from catalog.plain_text import printable
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.boundary import reason_of, trouble_of
from tasks.control.bundle import UNKNOWNS, Bundle, adjust_bundle
from tasks.control.camera_constants import constant_lines, constant_rows
from tasks.control.settings import ControlSettings
from tasks.control.ties import Ties, find_ties
from tasks.export.source import Source, read_source
from tasks.joint.parameters import RANGE
from tasks.mosaic.view import View, mixture_notes, view_of
from tasks.photometry.region import unreadable_products, usable_products
from tasks.project.uncertainty import ATTITUDE, PARAMETERS, PoseUncertainty

Array = NDArray[np.float64]
FEWEST_TIES = 10
FREE_RANGE_SIGMA = 0.02  # relative, of a range that the metadata do not give: as of poses from files


@dataclass(frozen=True)
class Control:
    """views: the images; folders: of their products; ties, bundle: see there; priors (images, 7, 7): of the poses;
    left_out: products that could not be read, and why."""

    views: tuple[View, ...]
    folders: tuple[Path, ...]
    ties: Ties
    bundle: Bundle
    priors: Array
    settings: ControlSettings
    left_out: tuple[tuple[str, str], ...]


def control_store(store: Path, settings: ControlSettings, say: Callable[[str], None] = lambda _: None) -> Control:
    """Tie the images of `store` to each other and adjust their poses. Raises RefusedError when fewer than two images
    can be used or they show several bodies, FailedError when they share no ground that matches."""
    folders, broken = usable_products(store, settings.doubtful), unreadable_products(store)
    views: list[View] = []
    read: list[Path] = []
    priors: list[Array] = []
    left_out: list[tuple[str, str]] = list(broken)

    def take(folder: Path) -> None:
        source = read_source(folder)
        view, prior = view_of(source), prior_of(json.loads(source.attributes["uncertainty"]), settings)
        if FOCAL_LENGTH in settings.solve:
            pose, prior = with_range_of_trajectory(source, prior)
            view = replace(view, pose=pose)
        views.append(view)
        priors.append(prior)
        read.append(folder)

    for folder in folders:
        error = trouble_of(lambda folder=folder: take(folder), folder.name)  # type: ignore[misc]
        if error is not None:
            left_out.append((printable(folder.name), reason_of(error)))
    targets = sorted({view.target.name for view in views})
    if len(targets) > 1:
        raise RefusedError(Reason.TARGETS_DIFFER, f"the images show {' and '.join(targets)}.", "Give one body's.")
    if len(views) < 2:
        fault = f"{store} has {len(views)} images that can be used; ties need two."
        raise RefusedError(Reason.NO_USABLE_IMAGE, fault, "Look at `planetpose index`.")
    for note in mixture_notes((view.filter, view.basemap) for view in views):
        say(note)
    ties = find_ties(views, settings)
    say(f"{len(views)} images, {len(ties.points)} points, {len(ties.image)} measures")
    if not len(ties.points):
        raise FailedError(
            Reason.NOTHING_TO_TIE, "no ground that two images show matches.", "Lower --least-correlation."
        )
    stacked = np.array(priors)
    poses, cameras = [view.pose for view in views], [view.camera for view in views]
    bundle = adjust_bundle(poses, cameras, views[0].target, ties, stacked, settings)
    return Control(tuple(views), tuple(read), ties, bundle, stacked, settings, tuple(left_out))


def prior_of(uncertainty: dict[str, Any], settings: ControlSettings) -> Array:
    """Covariance (7, 7) of a pose as its product states it; the settings' where it states nothing."""
    stated = PoseUncertainty.from_dict(uncertainty).covariance if "covariance" in uncertainty else np.zeros((7, 7))
    usual = np.array(
        [settings.prior_offset_px] * 2
        + [settings.prior_range, settings.prior_roll_deg]
        + [settings.prior_attitude_deg] * 3
    )
    covariance = stated.copy()
    for k in range(UNKNOWNS):
        least = settings.least_attitude_deg if k in range(*ATTITUDE.indices(UNKNOWNS)) else 0.0
        if stated[k, k] <= 0:
            covariance[k, :] = covariance[:, k] = 0
            covariance[k, k] = usual[k] ** 2
        elif stated[k, k] < least**2:
            covariance[k, k] = least**2
    return covariance


def with_range_of_trajectory(source: Source, prior: Array) -> tuple[Pose, Array]:
    """The pose and its covariance (7, 7) with the range, and its error, that the metadata give: the one from
    the image assumes the focal length that is to be found. As they are where no joint step says what the range was."""
    corrections = json.loads(source.attributes["provenance"]).get("corrections", {})
    evidence = [each["evidence"] for name, each in corrections.items() if name.startswith("joint")]
    if not evidence or "range_factor_prior_sigma" not in evidence[-1]:
        return source.pose, prior
    before = Pose.from_dict(json.loads(source.attributes["pose_before"]))
    sigma = evidence[-1]["range_factor_prior_sigma"]
    covariance = prior.copy()
    covariance[RANGE, :] = covariance[:, RANGE] = 0
    covariance[RANGE, RANGE] = (FREE_RANGE_SIGMA if sigma is None else float(sigma)) ** 2
    return source.pose.with_range_factor(before.range_km / source.pose.range_km), covariance


def image_rows(control: Control) -> list[dict[str, Any]]:
    """One row per image: ties, residuals, what the adjustment changed, and whether the image disagrees with others."""
    bundle, ties = control.bundle, control.ties
    sigma = np.sqrt(np.einsum("kii->ki", bundle.covariance))
    prior = np.sqrt(np.einsum("kii->ki", control.priors))
    rms = [_rms(bundle.residual_px[(ties.image == k) & bundle.used]) for k in range(len(control.views))]
    usual = np.median([value for value in rms if value is not None] or [0.0])
    rows = []
    for k, view in enumerate(control.views):
        mine = ties.image == k
        pull = np.abs(bundle.moves[k]) / prior[k]
        reasons = [
            f"{name} moved by {pull[i]:.1f} of its prior's sigmas" for i, name in enumerate(PARAMETERS) if pull[i] > 4
        ]
        if rms[k] is not None and rms[k] > 3 * usual > 0:
            reasons.append(f"residuals of {rms[k]:.2f} px")
        rejected = int((mine & ~bundle.used).sum())
        if mine.sum() >= FEWEST_TIES and rejected > 0.3 * mine.sum():
            reasons.append(f"{rejected} of {int(mine.sum())} ties rejected")
        few = "too few ties" if mine.sum() < FEWEST_TIES else ""
        rows.append(
            {
                "product": view.product,
                "ties": int(mine.sum()),
                "rejected": rejected,
                "rms_px": rms[k],
                "redundancy": float(bundle.redundancy[k]),
                "status": "disagrees" if reasons else few or "ok",
                "reason": "; ".join(reasons),
                **{name: float(bundle.moves[k, i]) for i, name in enumerate(PARAMETERS)},
                **{f"{name}_sigma": float(sigma[k, i]) for i, name in enumerate(PARAMETERS)},
            }
        )
    return rows


def _rms(residual: Array) -> float | None:
    """Of the length of residuals (n, 2)."""
    return float(np.sqrt((residual**2).sum(axis=1).mean())) if len(residual) else None


def control_report(control: Control) -> dict[str, Any]:
    """Plain values: totals as ISIS' cnetstats gives them, a row per image, and what was left out."""
    bundle, ties = control.bundle, control.ties
    count = np.bincount(ties.point, minlength=len(ties.points))
    kept = np.bincount(ties.point[bundle.used], minlength=len(ties.points))
    return {
        "images": len(control.views),
        "points": len(ties.points),
        "points_used": int((kept >= 2).sum()),
        "measures": len(ties.image),
        "measures_rejected": int((~bundle.used).sum()),
        "measures_per_point": float(count.mean()),
        "rms_px": _rms(bundle.residual_px[bundle.used]),
        "rms_sample_px": float(np.sqrt(np.mean(bundle.residual_px[bundle.used, 0] ** 2))),
        "rms_line_px": float(np.sqrt(np.mean(bundle.residual_px[bundle.used, 1] ** 2))),
        "sigma_scale": bundle.sigma_scale,
        "rounds": bundle.rounds,
        "cameras": constant_rows(bundle.constants, bundle.constants_covariance) if control.settings.solve else [],
        "rows": image_rows(control),
        "left_out": [{"product": product, "reason": reason} for product, reason in control.left_out],
    }


def control_table(report: dict[str, Any]) -> str:
    """The report for people."""
    lines = [
        *constant_lines(report["cameras"]),
        f"{report['points']} points ({report['points_used']} used), {report['measures']} measures "
        f"({report['measures_rejected']} rejected), RMS {report['rms_px']:.3f} px "
        f"(sample {report['rms_sample_px']:.3f}, line {report['rms_line_px']:.3f})",
        "image                     ties rejected   rms px  turned deg  sigma deg  status",
    ]
    for row in report["rows"]:
        turned = _length([row[f"attitude_{axis}_deg"] for axis in "xyz"])
        sigma = _length([row[f"attitude_{axis}_deg_sigma"] for axis in "xyz"]) / np.sqrt(3)
        rms = "-" if row["rms_px"] is None else f"{row['rms_px']:.3f}"
        state = f"{row['status']}: {row['reason']}" if row["reason"] else row["status"]
        counts = f"{row['product']:<24} {row['ties']:>5} {row['rejected']:>8}"
        lines.append(f"{counts} {rms:>8}  {turned:>10.3f} {sigma:>10.3f}  {state}")
    return "\n".join(lines)


def _length(values: Sequence[float]) -> float:
    return float(np.linalg.norm(values))
