"""Attitude: turn the target until its markings lie where the image has them (paper, section 5)."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from tasks.attitude.flow import optical_flow
from tasks.attitude.kabsch import robust_kabsch
from tasks.attitude.markings import CONFLICT_SIGMAS, UNKNOWN_DEG, is_borne_out, markings_at_pose
from tasks.bodies.masks import alone
from tasks.compare.brightness import correlation, fit_brightness
from tasks.compare.match import Match, match_scene
from tasks.compare.reduce import reduced_observation, reduced_scene
from tasks.correction import FORMAL, Correction
from tasks.project.points import body_points
from tasks.rest import REST_PX, rest_of
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Progress = Callable[[str, int, str], None]

# Between these radii the paper's boxes span some degrees and still see the markings.
COARSE_RADIUS_PX, FINE_RADIUS_PX = 100.0, 320.0
SMALLEST_RADIUS_PX = 40.0
# Markings are smooth; only limbs need more sub-pixels.
OVERSAMPLE = 2


class AttitudeSettings(BaseModel):
    """template_px, search_px: the paper's boxes. min_correlation: of a flow vector. min_vectors: fewer leave the
    attitude undetermined, and so does a match at less than min_share of the places with markings: the right markings
    match at more than 0.6 of them, chance (a wrong map, a body turned beyond the search) at 0.02 to 0.15. max_deg: a
    larger turn is accepted only where the markings, compared with what chance gives, support it strongly; None, the
    default, takes what the prior of the orientation contradicts (3 of its sigmas). A turn whose 1-sigma about some axis
    exceeds max_sigma_deg is never accepted. min_lit: weakest simulated shading, relative to the brightest, at which
    markings are compared.

    max_turns: how often, at most, flow is measured again at the last resolution, with a new simulation each time (the
    paper: once); it has settled when a turn is smaller than settle_deg, or than half its own error, or when the turns
    go to and fro within rest_px at the limb, or their error, of the middle of their way, which is then taken.

    place_px: error of the disk's place in the image, 1-sigma, which the flow takes for a turn. It and the map's
    frame (`Scene.map_frame_deg`) are in the stated error, beside the scatter of the flow; place_px is measured
    (docs/method/uncertainty.md)."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    template_px: int = Field(13, ge=3)
    search_px: int = Field(21, ge=5)
    min_correlation: float = Field(0.5, ge=-1, le=1)
    min_vectors: int = Field(200, ge=3)
    min_share: float = Field(0.25, ge=0, le=1)
    min_lit: float = Field(0.15, ge=0, lt=1)
    max_deg: float | None = Field(None, gt=0)
    max_sigma_deg: float = Field(1.0, gt=0)
    max_turns: int = Field(5, ge=1, le=50)
    settle_deg: float = Field(0.01, gt=0)
    rest_px: float = Field(REST_PX, ge=0)
    place_px: float = Field(0.1, ge=0)


@dataclass(frozen=True)
class Turn:
    """One estimate: the pose after it, the rotation vector in the body frame before it (3,), degrees, its 1-sigma
    (3,), and counts; or why there is none."""

    pose: Pose
    vector_deg: NDArray[np.float64] | None
    sigma_deg: NDArray[np.float64] | None
    evidence: dict[str, Any]


def find_attitude(
    observation: Observation,
    pose: Pose,
    scene: Scene,
    settings: AttitudeSettings,
    progress: Progress | None = None,
    prior_deg: float = UNKNOWN_DEG,
) -> Correction:
    """Correct the attitude of the target by optical flow and Kabsch; camera and distance stay.

    Large disks are first compared at reduced resolution, so that the search box spans some degrees. When the image
    cannot tell (too few or too poor vectors, an unbelievable turn, or a turn that makes the images less alike) the
    pose is returned unchanged with `attitude_deg` None and the reason in the evidence: that is an answer, no failure.
    Where the map has markings and the image others, the evidence holds a `doubt` as well. prior_deg: 1-sigma of the
    orientation at the start, see `AttitudeSettings.max_deg`. converged, and `settled` in
    the evidence: whether turning came to rest within `max_turns`.
    """
    observation = alone(observation, pose, scene)
    radius = disk_radius_px(pose, scene.camera, scene.target)
    reductions = [n for n in (8, 4, 2, 1) if COARSE_RADIUS_PX <= radius / n <= FINE_RADIUS_PX] or [1]
    scene = replace(scene, settings=scene.settings.model_copy(update={"oversample": OVERSAMPLE}))
    quick = reductions[0]
    turned, turns, settled = pose, [], False
    last: list[NDArray[np.float64]] = []
    match, at = simulated_match(observation, scene, pose, quick), quick
    before, turn = likeness(match), one_turn(match, settings)
    if turn.vector_deg is None and radius / (2 * reductions[0]) >= SMALLEST_RADIUS_PX:
        reductions.insert(0, 2 * reductions[0])  # the markings may be beyond the search: seen from afar they are not
    for iteration, reduction in enumerate([*reductions, *reductions[-1:] * (settings.max_turns - 1)], 1):
        if match.pose is not turned or at != reduction:
            match, at = simulated_match(observation, scene, turned, reduction), reduction
            turn = one_turn(match, settings)
        turns.append({"reduction": reduction, **turn.evidence})
        turned = turn.pose
        if progress:
            progress("attitude", iteration, turn_text(turn))
        if iteration < len(reductions):
            continue
        if turn.vector_deg is None or turn.sigma_deg is None:
            break
        settled = is_still(turn, settings.settle_deg)
        if not settled:
            last.append(turn.vector_deg)
            rested = at_rest(turn, last, radius / reduction, settings.rest_px)
            turn, settled = rested or turn, rested is not None
            turned = turn.pose
        if settled:
            break
    after = likeness(simulated_match(observation, scene, turned, quick))
    # As matrices: the body frame after is R^T times the one before, R the turn of the body in its own frame.
    whole = vector_deg_from_rotation((turned.body_from_j2000 @ pose.body_from_j2000.T).T)
    evidence: dict[str, Any] = {
        "turns": turns,
        "settled": settled,
        "correlation_before": before,
        "correlation_after": after,
    }
    reason = why_not(turn, before, after, settings)
    if reason is None:
        reason = why_not_so_far(observation, turned, whole, scene, settings, prior_deg)
    if reason is not None:
        evidence |= {"undetermined": reason, "settled": None}
        if turn.evidence.get("mismatch") or "not believable" in reason:
            evidence["doubt"] = (
                f"{Reason.MARKINGS_DO_NOT_MATCH}: "
                f"{reason}. Check the predicted attitude, the camera's roll and the base map."
            )
        return Correction("attitude", pose, {"attitude_deg": None}, {"attitude_deg": None}, evidence)
    stated, formal = None, turn.sigma_deg
    if formal is not None:
        evidence[FORMAL] = {"attitude_deg": formal.tolist()}
        systematic = np.hypot(scene.map_frame_deg, np.degrees(settings.place_px / radius))
        stated = np.hypot(formal, systematic).tolist()
        evidence["map_frame_deg"] = scene.map_frame_deg
    return Correction("attitude", turned, {"attitude_deg": whole.tolist()}, {"attitude_deg": stated}, evidence, settled)


def simulated_match(observation: Observation, scene: Scene, pose: Pose, reduction: int) -> Match:
    """Image and simulation of `pose` at a fraction of the resolution."""
    return match_scene(reduced_observation(observation, reduction), reduced_scene(scene, reduction), pose)


def is_still(turn: Turn, settle_deg: float) -> bool:
    """Whether the turn is too small to matter."""
    if turn.vector_deg is None or turn.sigma_deg is None:
        return False
    return bool((np.abs(turn.vector_deg) <= np.maximum(settle_deg, turn.sigma_deg / 2)).all())


def at_rest(turn: Turn, turns_deg: list[NDArray[np.float64]], radius_px: float, rest_px: float) -> Turn | None:
    """The middle of the way of the last turns, their scatter in its error, where they lead nowhere any more."""
    if turn.sigma_deg is None:
        return None
    rest = rest_of(turns_deg, max(float(np.degrees(rest_px / radius_px)), float(np.linalg.norm(turn.sigma_deg))))
    if rest is None:
        return None
    back = rotation_from_vector_deg(rest.back)
    pose = turn.pose.replaced(body_from_j2000=back.T @ turn.pose.body_from_j2000)
    return replace(turn, pose=pose, sigma_deg=np.hypot(turn.sigma_deg, rest.scatter))


def why_not(turn: Turn, before: float, after: float, settings: AttitudeSettings) -> str | None:
    """Why the turns so far are not accepted, or None."""
    if turn.vector_deg is None or turn.sigma_deg is None:
        return str(turn.evidence["reason"])
    if turn.sigma_deg.max() > settings.max_sigma_deg:
        return f"the turn is uncertain by {turn.sigma_deg.max():.1f} deg (limit {settings.max_sigma_deg} deg)"
    if after < before - 1e-4:
        return f"the turn makes image and simulation less alike ({before:.4f} to {after:.4f})"
    return None


def why_not_so_far(
    observation: Observation,
    turned: Pose,
    whole_deg: NDArray[np.float64],
    scene: Scene,
    settings: AttitudeSettings,
    prior_deg: float,
) -> str | None:
    """Why a turn of the body by `whole_deg` (3,) is larger than can be accepted, or None."""
    angle = float(np.linalg.norm(whole_deg))
    limit = CONFLICT_SIGMAS * prior_deg if settings.max_deg is None else settings.max_deg
    if angle <= limit or is_borne_out(markings_at_pose(observation, turned, scene, prior_deg)):
        return None
    return (
        f"a turn of {angle:.1f} deg is not believable (limit {limit:g} deg), "
        "for the markings do not support it strongly"
    )


def turn_text(turn: Turn) -> str:
    """The estimate for the progress display."""
    if turn.vector_deg is None:
        return f"no turn: {turn.evidence['reason']}"
    return f"{turn.evidence['vectors']} flow vectors, turn of {float(np.linalg.norm(turn.vector_deg)):.3f} deg"


def one_turn(match: Match, settings: AttitudeSettings) -> Turn:
    """Flow on the shading-free images, vectors carried to the body, robust Kabsch."""
    pose, scene = match.pose, match.scene
    image, texture, comparable = without_shading(match, settings.min_lit)
    flow = optical_flow(image, texture, comparable, settings.template_px, settings.search_px)
    good = flow.valid & (flow.correlation >= settings.min_correlation)
    count, places = int(good.sum()), int(flow.places.sum())
    evidence: dict[str, Any] = {"vectors": count, "share": round(count / max(places, 1), 4)}
    if count < settings.min_share * places and places * settings.min_share >= settings.min_vectors:
        reason = f"the map's markings match at only {count / places:.0%} of the places compared"
        return Turn(pose, None, None, evidence | {"reason": reason, "mismatch": True})
    if count < max(settings.min_vectors, settings.min_share * places):
        return Turn(pose, None, None, evidence | {"reason": f"only {count} flow vectors, too bland a disk or map"})
    y, x = np.nonzero(good)
    here = np.stack([x, y], axis=-1) + np.asarray(match.origin)
    there = here + flow.displacement[good]
    p = body_points(pose, scene.camera, scene.target, here)
    q = body_points(pose, scene.camera, scene.target, there)
    on_body = np.isfinite(p).all(axis=-1) & np.isfinite(q).all(axis=-1)
    p, q, weight = p[on_body], q[on_body], flow.correlation[good][on_body]
    try:
        rotation, kept = robust_kabsch(p, q, weight)
    except ValueError as error:
        return Turn(pose, None, None, evidence | {"reason": str(error)})
    evidence["kept"] = int(kept.sum())
    if kept.sum() < 0.3 * len(p):
        return Turn(pose, None, None, evidence | {"reason": "the flow vectors do not agree on one rotation"})
    independent = max(kept.sum() / settings.template_px**2, 1.0)
    sigma = rotation_sigma_deg(p[kept], q[kept], rotation, independent)
    turned = pose.replaced(body_from_j2000=rotation.T @ pose.body_from_j2000)
    return Turn(turned, vector_deg_from_rotation(rotation), sigma, evidence)


def without_shading(match: Match, min_lit: float) -> tuple[NDArray, NDArray, NDArray[np.bool_]]:
    """Image and simulation divided by the fitted shading, and the pixels where that is safe.

    Shading is tied to the Sun, not to the ground: left in, it pulls every template towards no motion.
    """
    simulation = match.simulation
    model, coefficients = fit_brightness(match, simulation.bases)
    k = len(simulation.of_target)
    shading = np.tensordot(coefficients[:k], simulation.shading, 1)
    background = model - np.tensordot(coefficients[:k], simulation.of_target, 1)
    inside = simulation.coverage > 0.999
    bright = shading > min_lit * np.percentile(shading[inside], 95) if inside.any() else inside
    safe = inside & bright
    divisor = np.where(safe, shading, 1.0)
    image = np.where(safe, (match.image - background) / divisor, 0).astype(np.float32)
    texture = np.where(safe, (model - background) / divisor, 0).astype(np.float32)
    return image, texture, safe & match.usable


def rotation_sigma_deg(p: NDArray, q: NDArray, rotation: NDArray, independent: float) -> NDArray[np.float64]:
    """1-sigma (3,) of the rotation vector from the scatter of the points, `independent` of which count."""
    residual = q - p @ rotation.T
    variance = float((residual**2).sum()) / (2 * len(p))
    normal = np.eye(3) * (p**2).sum() - p.T @ p
    covariance = np.linalg.pinv(normal / len(p)) * variance / independent
    return np.degrees(np.sqrt(np.diag(covariance)))


def likeness(match: Match) -> float:
    """Correlation of image and brightness-fitted simulation."""
    model, _ = fit_brightness(match, match.simulation.bases)
    return correlation(match.image, model, match.usable)
