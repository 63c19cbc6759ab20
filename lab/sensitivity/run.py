"""The joint step with each threshold halved and doubled, one after the other."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from catalog.errors import FailedError
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
    """Of one image: error and stated 1-sigma (3,) of the centre's x and y and of the limb by the range, px; whether the
    result was doubted. NaN where the step failed."""

    error: Array
    sigma: Array
    doubted: bool


@dataclass(frozen=True)
class Row:
    """One threshold times `factor`: its value; moved_sigmas: the largest change of centre or limb, in the sigmas of the
    settings as they are; widened: the largest change of a stated sigma, relative; rms_px, rms_z: errors and errors over
    sigmas of all images; doubts, failed: images."""

    name: str
    default: Any
    factor: float
    moved_sigmas: float
    widened: float
    rms_px: float
    rms_z: float
    doubts: int
    failed: int


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
        return Outcome(np.full(3, np.nan), np.full(3, np.nan), True)
    error = pose_error(found.pose, case.truth, camera, target)
    radius = disk_radius_px(case.truth, camera, target)
    stated = found.uncertainty
    sigma = np.array([*stated["offset_px"], (stated["range_factor"] or np.nan) * radius], np.float64)
    return Outcome(np.array([*error.centre_px, error.range * radius]), sigma, bool(found.evidence.get("doubt")))


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
        float(np.sqrt(np.nanmean(errors**2))),
        float(np.sqrt(np.nanmean((errors / sigmas) ** 2))),
        sum(each.doubted for each in after),
        sum(bool(np.isnan(each.error).all()) for each in after),
    )


def largest(values: Array) -> float:
    """The value of the largest size; 0 for none."""
    known = values[np.isfinite(values)]
    return float(known[np.argmax(np.abs(known))]) if known.size else 0.0
