"""The entries `bodies` of a pose file: short forms made whole from the catalog and from the pose itself."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from catalog.body import Target
from catalog.placed_body import LIGHT_KM_PER_S, PlacedBody, body_from_dict
from catalog.pose import Pose
from catalog.target import known_target

FROM_SPACECRAFT = "from_spacecraft_km"


def bodies_given(entries: tuple[Mapping[str, Any], ...], pose: Pose, target: Target) -> tuple[PlacedBody, ...]:
    """The bodies of a pose file. Each entry needs `name` and `from_target_km`, or `from_spacecraft_km` in its place
    (km, J2000, as the spacecraft sees it); what else it lacks is the catalog's (radii, rings, rotation model) and the
    pose's (the Sun). Raises ValueError naming the entry, the fault and the remedy."""
    bodies = tuple(_body_given(dict(entry), number, pose) for number, entry in enumerate(entries))
    ids = [target.naif_id, *(body.naif_id for body in bodies)]
    twice = sorted({body.name for body in bodies if ids.count(body.naif_id) > 1})
    if twice:
        raise ValueError(f"bodies: {', '.join(twice)} is there twice, or is the target {target.name} itself")
    return bodies


def _body_given(entry: dict[str, Any], number: int, pose: Pose) -> PlacedBody:
    known = known_target(str(entry.get("name", "")))
    position = _relative(entry, number, pose)
    entry.setdefault("sun_from_body_km", (pose.sun_from_target_km - position).tolist())
    if known is None:
        return body_from_dict({**entry, "from_target_km": position.tolist()}, number)
    distance_km = float(np.linalg.norm(pose.target_from_spacecraft_km + position))
    if "body_from_j2000" not in entry and known.rotation is not None:
        turned = known.rotation.body_from_j2000(pose.et - distance_km / LIGHT_KM_PER_S)
        entry["body_from_j2000"] = turned.tolist()
    whole = PlacedBody.of(known, from_target_km=tuple(position), sun_from_body_km=tuple(entry["sun_from_body_km"]))
    return body_from_dict({**whole.to_dict(), **entry, "from_target_km": position.tolist()}, number)


def _relative(entry: dict[str, Any], number: int, pose: Pose) -> np.ndarray:
    """Position relative to the target (3,), km."""
    given = entry.pop(FROM_SPACECRAFT, None)
    if (given is None) == (entry.get("from_target_km") is None):
        name = entry.get("name", "without a name")
        raise ValueError(f"bodies[{number}] ({name}) needs from_target_km or {FROM_SPACECRAFT}, one of them")
    try:
        position = np.array(entry["from_target_km"] if given is None else given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"bodies[{number}]: its position is not three numbers") from error
    if position.shape != (3,):
        raise ValueError(f"bodies[{number}]: its position is not three numbers")
    if given is None:
        return position
    return np.asarray(position - pose.target_from_spacecraft_km)
