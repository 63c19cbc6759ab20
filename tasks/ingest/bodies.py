"""The other bodies of an image, from its pose file, or from the kernels that cover them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.given_bodies import bodies_given
from catalog.placed_body import PlacedBody
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.spice_bodies import bodies_from_loaded, seeing_each_other
from catalog.target import Target, find_target, further_targets, known_targets
from tasks.bodies.placed import DEFAULTS, relevant
from tasks.simulate.others import OtherBodiesSettings

NO_BODIES = "none"


@dataclass(frozen=True)
class Candidates:
    """Bodies that kernels may place. named: whether the user named them, who then wants to know what is missing."""

    targets: tuple[Target, ...] = ()
    named: bool = False


def candidates_for(names: Sequence[str], target: Target, kernels: Sequence[Path]) -> Candidates:
    """Those of the names; without names the catalog's where there are kernels; nothing for `none`. Raises RefusedError
    for a name that nobody knows."""
    if [name.lower() for name in names] == [NO_BODIES]:
        return Candidates()
    if names:
        return Candidates(tuple(_named(name, kernels) for name in names), named=True)
    if not kernels:
        return Candidates()
    catalog = {**further_targets(), **known_targets()}
    return Candidates(tuple(each for each in catalog.values() if each.naif_id != target.naif_id))


def _named(name: str, kernels: Sequence[Path]) -> Target:
    try:
        return find_target(name, kernels)
    except RefusedError as error:
        remedy = "Check the name of --body: `planetpose targets` lists the catalog's; others need a PCK (--kernels)."
        raise RefusedError(Reason.BODY_UNKNOWN, error.fault, remedy) from error


def bodies_of_image(
    pose: Pose,
    camera: Camera,
    target: Target,
    given: Iterable[PlacedBody | Mapping[str, Any]],
    candidates: Candidates,
    pose_file: Path | None = None,
    settings: OtherBodiesSettings = DEFAULTS,
) -> tuple[PlacedBody, ...]:
    """What may be in the frame beside the target, shadow what is, or light its night side: the pose file's bodies, all
    of them, and those of the candidates that the loaded kernels cover.

    Raises RefusedError for bad entries of the pose file, and for a body that the user named and nothing places.
    """
    entries = tuple(each if isinstance(each, Mapping) else each.to_dict() for each in given)
    try:
        from_file = bodies_given(entries, pose, target)
    except ValueError as error:
        remedy = "Give each body a name and from_target_km or from_spacecraft_km (docs/guide/bodies.md)."
        raise RefusedError(Reason.POSE_FILE_INVALID, f"pose file {pose_file}: {error}.", remedy) from error
    known = {body.naif_id for body in from_file} | {target.naif_id}
    wanted = [each for each in candidates.targets if each.naif_id not in known]
    placed = bodies_from_loaded(camera, target, pose.et, wanted) if wanted else []
    if candidates.named:
        _refuse_missing([each.name for each in wanted], [body.name for body in placed], camera, target)
        chosen = placed
    else:
        needed = {body.naif_id for body in relevant(pose, camera, target, [*from_file, *placed], settings)}
        chosen = [body for body in placed if body.naif_id in needed]
    return (*from_file, *(seeing_each_other(camera, target, pose.et, chosen) if chosen else ()))


def _refuse_missing(wanted: list[str], placed: list[str], camera: Camera, target: Target) -> None:
    missing = [name for name in wanted if name not in placed]
    if missing:
        fault = f"no loaded kernel places {', '.join(missing)} relative to {target.name} as seen from {camera.name}"
        remedy = "Load an SPK that covers them (--kernels), or place them by `bodies` of a pose file (--pose)."
        raise RefusedError(Reason.BODY_UNKNOWN, f"{fault}.", remedy)
