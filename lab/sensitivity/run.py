"""The joint step with each threshold halved and doubled, one after the other."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from catalog.errors import FailedError
from lab.honesty.assess import orientation, stated_covariance
from lab.sensitivity.cases import Case
from lab.simulate.plant import pose_error
from tasks.joint import JointSettings, find_pose_jointly
from tasks.joint.settings import TileSettings
from tasks.joint.thresholds import Thresholds
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
FACTORS = (0.5, 2.0)
# Thresholds of the tiles; the other fields of their settings are priors and sizes.
OF_TILES = ("fewest", "smallest", "heavy_tail", "chance", "seen")
# Only these are about the second start, which takes as long as all the rest.
SECOND = ("second_", "disagreement_px", "surely_worse", "starts_conflict_sigmas")


@dataclass(frozen=True)
class Outcome:
    """Of one image: error and stated 1-sigma (6,) of the centre's x and y and of the limb by the range, px, and of the
    body's turn in the camera: two components across the line of sight and one about it, degrees; whether the result
    was doubted. NaN where the step failed, or states nothing."""

    error: Array
    sigma: Array
    doubted: bool

    @property
    def failed(self) -> bool:
        """Whether there is no result."""
        return bool(np.isnan(self.error).all())


@dataclass(frozen=True)
class Row:
    """One threshold times `factor`: its value; moved_sigmas: the largest change of centre, limb or orientation, in the
    sigmas of the settings as they are; widened: the largest change of a stated sigma, relative; rms_px: errors of
    centre and limb of all images; rms_z: all errors over their sigmas; doubts, failed: images; verdicts: images whose
    doubt or failure is not that of the settings as they are."""

    name: str
    default: Any
    factor: float
    moved_sigmas: float
    widened: float
    rms_px: float
    rms_z: float
    doubts: int
    failed: int
    verdicts: int = 0

    @property
    def weight(self) -> float:
        """The largest of the changes; a changed verdict counts as 1."""
        return max(abs(self.moved_sigmas), abs(self.widened), self.verdicts)


def threshold_names() -> list[str]:
    """`part.field` of every threshold of the joint step."""
    parts: dict[str, BaseModel] = dict(Thresholds())
    nested = [f"{part}.{field}" for part, limits in parts.items() for field in type(limits).model_fields]
    return [*nested, *(f"tiles.{field}" for field in OF_TILES)]


def value_of(settings: JointSettings, name: str) -> Any:
    """A threshold's value."""
    part, field = name.split(".")
    return getattr(settings.tiles if part == "tiles" else getattr(settings.thresholds, part), field)


def changed(settings: JointSettings, name: str, factor: float) -> JointSettings | None:
    """The settings with one threshold times `factor`, whole numbers rounded; None where that is no other value, or none
    that is allowed."""
    part, field = name.split(".")
    old = value_of(settings, name)
    new = scaled(old, factor)
    if new == old:
        return None
    try:
        if part == "tiles":
            return settings.model_copy(update={"tiles": TileSettings(**{**settings.tiles.model_dump(), field: new})})
        whole = settings.thresholds.model_dump()
        whole[part][field] = new
        return settings.model_copy(update={"thresholds": Thresholds.model_validate(whole)})
    except ValidationError:
        return None


def scaled(value: Any, factor: float) -> Any:
    """A value times `factor`; of whole numbers the nearest above zero."""
    if isinstance(value, tuple):
        return tuple(each * factor for each in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def outcome(case: Case, settings: JointSettings) -> Outcome:
    """What the joint step makes of one image."""
    camera, target = case.scene.camera, case.scene.target
    try:
        found = find_pose_jointly(case.observation, case.start, case.predicted, "file", case.scene, settings)
    except FailedError:
        return Outcome(np.full(6, np.nan), np.full(6, np.nan), True)
    error = pose_error(found.pose, case.truth, camera, target)
    radius = disk_radius_px(case.truth, camera, target)
    stated = found.uncertainty
    covariance = stated_covariance({**stated, "centre_px": stated["offset_px"]}, found.evidence["covariance"])
    turned = orientation(found.pose.to_dict(), case.truth.to_dict(), covariance, stated)
    turns = [turned[key] for key in ("across_deg", "roll_deg")]
    unknown = ([np.nan] * 2, [np.nan])
    turn_sigmas = [turn["sigma"] or none for turn, none in zip(turns, unknown, strict=True)]
    sigma = np.hstack([stated["offset_px"], (stated["range_factor"] or np.nan) * radius, *turn_sigmas])
    errors = np.hstack([error.centre_px, error.range * radius, *(turn["error"] for turn in turns)])
    return Outcome(errors, sigma.astype(np.float64), bool(found.evidence.get("doubt")))


def sensitivity(
    cases: Sequence[Case],
    settings: JointSettings,
    minutes: float | None = None,
    tell: Callable[[str], None] = lambda _: None,
    names: Sequence[str] | None = None,
) -> Iterator[Row]:
    """A row for each threshold and factor, and first one for the settings as they are. minutes: no threshold is begun
    later."""
    end = time.monotonic() + 60 * minutes if minutes is not None else np.inf
    quick = settings.model_copy(update={"second_start": False})
    before = {second: [outcome(case, each) for case in cases] for second, each in ((False, quick), (True, settings))}
    yield row_of("as they are", None, 1.0, before[True], before[True])
    for name in names or threshold_names():
        if time.monotonic() > end:
            return
        second = name.split(".")[1].startswith(SECOND)
        own = settings if second else quick
        for factor in FACTORS:
            other = changed(own, name, factor)
            if other is None:
                continue
            after = [outcome(case, other) for case in cases]
            row = row_of(name, value_of(settings, name), factor, before[second], after)
            tell(f"{name} x {factor:g}: moved {row.moved_sigmas:.3f} sigma, stated {row.widened:+.1%}")
            yield row


def row_of(name: str, default: Any, factor: float, before: Sequence[Outcome], after: Sequence[Outcome]) -> Row:
    """Compare two sets of outcomes of the same images."""
    moved = np.array([np.abs(a.error - b.error) / b.sigma for a, b in zip(after, before, strict=True)])
    widened = np.array([a.sigma / b.sigma - 1 for a, b in zip(after, before, strict=True)])
    errors, sigmas = (np.array([getattr(each, key) for each in after]) for key in ("error", "sigma"))
    return Row(
        name,
        default,
        factor,
        largest(moved),
        largest(widened),
        float(np.sqrt(np.nanmean(errors[:, :3] ** 2))),
        float(np.sqrt(np.nanmean((errors / sigmas) ** 2))),
        sum(each.doubted for each in after),
        sum(each.failed for each in after),
        sum((a.doubted, a.failed) != (b.doubted, b.failed) for a, b in zip(after, before, strict=True)),
    )


def largest(values: Array) -> float:
    """The value of the largest size; 0 for none."""
    known = values[np.isfinite(values)]
    return float(known[np.argmax(np.abs(known))]) if known.size else 0.0
