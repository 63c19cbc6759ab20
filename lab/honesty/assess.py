"""A result against the truth: errors, their stated sigmas, and what a verdict `ok` must not hide. Pure functions of the
rows that `lab.honesty.run` writes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lab.honesty.scene import ATTITUDE_SIGMA_DEG, ROLL_SIGMA_DEG

Array = NDArray[np.float64]
Row = dict[str, Any]
# The bar: wrong is what is off by so many sigmas, and by more than what anybody would notice.
SIGMAS = 4.0
CENTRE_PX, LIMB_PX, SUBPOINT_DEG, SUN_DEG = 0.3, 0.3, 1.0, 5.0
OFFSET, RANGE, ROLL, ATTITUDE = slice(0, 2), 2, 3, slice(4, 7)


def assess(row: Row) -> Row | None:
    """Errors of a published pose (`row` with scene, truth, result, covariance); None without one.

    centre_px: (dx, dy), their sigmas and z, and `mahalanobis`, the distance in sigmas along the worst direction. range:
    relative, and as `limb_px` of the disk's radius. subpoint_deg: great circle between the true and the found
    sub-spacecraft points; its z is the distance in sigmas along the worst direction. across_deg: the body's turn in the
    camera, about the picture's x and y. roll_deg: the same about the line of sight, the camera's roll included.
    sun_deg: between the Sun's directions. stated: False where the result gives no sigma, and that of the prior of a
    pose file is taken in its place: what is published unsaid is as good as its source.
    """
    result, truth = row["result"], row["truth"]
    if result["pose"] is None:
        return None
    found, true = result["pose"], truth["pose"]
    stated = stated_covariance(result["uncertainty"], row["covariance"])
    radius_px = row["scene"]["radius_px"]
    place = np.asarray(result["centre_px"]) - np.asarray(truth["place_px"])
    ranges = [float(np.linalg.norm(p["target_from_spacecraft_km"])) for p in (found, true)]
    relative = ranges[0] / (ranges[1] * truth["range_scale"]) - 1
    return {
        "centre_px": with_sigmas(place, stated[OFFSET, OFFSET]),
        "range": with_sigmas(np.array([relative]), stated[2:3, 2:3]) | {"limb_px": float(relative * radius_px)},
        **orientation(found, true, stated, result["uncertainty"]),
        "sun_deg": between_deg(found["sun_from_target_km"], true["sun_from_target_km"]),
    }


def stated_covariance(uncertainty: Mapping[str, Any], covariance: Any) -> Array:
    """Covariance (7, 7) of centre x, y (px), range (relative), roll and attitude (deg, body axes): stated sigmas, with
    the correlations of `covariance` (8, 8) where the joint step tells them; NaN rows and columns where none is
    stated."""
    sigmas = np.full(7, np.nan)
    for place, key in ((OFFSET, "centre_px"), (RANGE, "range_factor"), (ROLL, "roll_deg"), (ATTITUDE, "attitude_deg")):
        if uncertainty.get(key) is not None:
            sigmas[place] = uncertainty[key]
    correlation = np.eye(7)
    if covariance is not None:
        own = np.asarray(covariance, dtype=np.float64)[:7, :7]
        scale = np.sqrt(np.outer(np.diag(own), np.diag(own)))
        correlation = np.where(scale > 0, own / np.where(scale > 0, scale, 1), np.eye(7))
    return np.asarray(correlation * np.outer(sigmas, sigmas))


def with_sigmas(error: Array, covariance: Array) -> Row:
    """An error (n,) with its sigmas and z, component by component, and its distance in sigmas along the worst
    direction; None where they are not stated."""
    reported: Row = {"error": error.tolist(), "size": float(np.linalg.norm(error))}
    sigmas = np.sqrt(np.diag(covariance))
    if not (np.isfinite(covariance).all() and (sigmas > 0).all()):
        return reported | {"sigma": None, "z": None, "mahalanobis": None}
    unit = covariance / np.outer(sigmas, sigmas)
    scaled = error / sigmas
    squared = float(scaled @ np.linalg.pinv(unit, rcond=1e-9, hermitian=True) @ scaled)
    distance = float(np.sqrt(max(squared, 0.0)))
    return reported | {"sigma": sigmas.tolist(), "z": scaled.tolist(), "mahalanobis": distance}


def orientation(
    found: Mapping[str, Any], true: Mapping[str, Any], stated: Array, uncertainty: Mapping[str, Any]
) -> Row:
    """`subpoint_deg`, `across_deg` and `roll_deg` of `assess`."""
    body, true_body = (np.asarray(p["body_from_j2000"]) for p in (found, true))
    camera, true_camera = (np.asarray(p["camera_from_j2000"]) for p in (found, true))
    attitude_is_stated = uncertainty.get("attitude_deg") is not None
    roll_is_stated = uncertainty.get("roll_deg") is not None
    attitude = stated[ATTITUDE, ATTITUDE] if attitude_is_stated else np.eye(3) * ATTITUDE_SIGMA_DEG**2
    roll = stated[ROLL, ROLL] if roll_is_stated else ROLL_SIGMA_DEG**2
    both = np.zeros((4, 4))
    both[0, 0], both[1:, 1:] = roll, attitude
    if attitude_is_stated and roll_is_stated:
        both[0, 1:] = both[1:, 0] = stated[ROLL, ATTITUDE]

    seen_from, seen_from_true = (
        -b @ np.asarray(p["target_from_spacecraft_km"]) for b, p in ((body, found), (true_body, true))
    )
    u, v = (w / np.linalg.norm(w) for w in (seen_from_true, seen_from))
    angle = between_deg(u, v)
    east, north = tangents(u)
    towards = v - (v @ u) * u
    length = float(np.linalg.norm(towards))
    # Half round the body every direction leads there.
    towards = towards / length * angle if length > 1e-12 else (east * angle if angle > 90 else np.zeros(3))
    across_body = np.stack([np.cross(u, east), np.cross(u, north)])  # a turn w moves u by w x u
    moved = with_sigmas(np.array([towards @ east, towards @ north]), across_body @ attitude @ across_body.T)

    camera_from_body = camera @ body.T
    turn = Rotation.from_matrix(camera_from_body @ (true_camera @ true_body.T).T)
    in_camera = np.degrees(turn.as_rotvec())
    sight = camera @ np.asarray(found["target_from_spacecraft_km"])
    sight = sight / np.linalg.norm(sight)
    leads = np.concatenate([sight[:, None], camera_from_body], axis=1)  # of roll and attitude to a turn in the camera
    covariance = leads @ both @ leads.T
    x, y = tangents(sight)
    planes = np.stack([x, y])
    across = with_sigmas(planes @ in_camera, planes @ covariance @ planes.T)
    about = with_sigmas(np.array([sight @ in_camera]), (sight @ covariance @ sight)[None, None])
    return {
        "subpoint_deg": moved | {"stated": attitude_is_stated},
        "across_deg": across | {"stated": attitude_is_stated},
        "roll_deg": about | {"stated": attitude_is_stated or roll_is_stated},
    }


def tangents(u: Array) -> tuple[Array, Array]:
    """Two unit vectors across `u` and each other; the first as near to +x as can be."""
    axis = np.eye(3)[0 if abs(u[0]) < 0.9 else 1]
    first = axis - (axis @ u) * u
    first /= np.linalg.norm(first)
    return first, np.cross(u, first)


def between_deg(a: Any, b: Any) -> float:
    """Angle between two vectors (3,)."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def violations(row: Row, errors: Row | None) -> list[Row]:
    """What is wrong with an `ok`, one entry for each kind: `foreign` (another body, or mirrored), `centre`, `range`,
    `subpoint`, `roll` (the same limits as the sub-spacecraft point's), `sun`. Without a stated sigma a limit in pixels
    or degrees is the only one."""
    if row["result"]["status"] != "ok" or errors is None:
        return []
    scene = row["scene"]
    if scene["foreign"]:
        return [violation(row, "foreign", errors["centre_px"], errors["centre_px"]["size"])]
    found = []
    limits = (
        ("centre", "centre_px", errors["centre_px"]["size"], CENTRE_PX),
        ("range", "range", abs(errors["range"]["limb_px"]), LIMB_PX),
        ("subpoint", "subpoint_deg", errors["subpoint_deg"]["size"], SUBPOINT_DEG),
        ("roll", "roll_deg", errors["roll_deg"]["size"], SUBPOINT_DEG),
    )
    for kind, key, size, limit in limits:
        if size > limit and worst_z(errors[key]) > SIGMAS:
            found.append(violation(row, kind, errors[key], size))
    if errors["sun_deg"] > SUN_DEG:
        found.append({"id": row["id"], "group": scene["group"], "kind": "sun", "size": errors["sun_deg"], "z": None})
    return found


def worst_z(error: Row) -> float:
    """Distance in sigmas along the worst direction, components included; infinite where no sigma is stated."""
    if error["z"] is None:
        return float("inf")
    return float(max(error["mahalanobis"], *(abs(z) for z in error["z"])))


def violation(row: Row, kind: str, error: Row, size: float) -> Row:
    """One entry of the list."""
    z = worst_z(error)
    return {
        "id": row["id"],
        "group": row["scene"]["group"],
        "kind": kind,
        "size": size,
        "error": error["error"],
        "sigma": error["sigma"],
        "z": z if np.isfinite(z) else None,
    }
