"""The orientation of the joint solution, tested by the markings, and what to keep of it.

Least squares always finds a turn of the body. It is kept where the image's markings support it better than the
predicted orientation; else the body stays as predicted, known as well as its prior says, and centre and range less
well by their correlation with it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.rotation import vector_deg_from_rotation
from tasks.attitude.markings import (
    CONFLICT_SIGMAS,
    Markings,
    compared_markings,
    evidence_of,
    is_borne_out,
    measurements,
    mismatch_of,
)
from tasks.attitude.texture import Texture, texture_of
from tasks.joint.coarse_to_fine import Estimate
from tasks.joint.outline import outline_spread
from tasks.joint.parameters import ATTITUDE, PSF, State, difference
from tasks.joint.problem import Problem
from tasks.joint.thresholds import OrientationThresholds
from tasks.simulate import Scene

Array = NDArray[np.float64]
# From a start and with or without the orientation held: the estimate, and the report where the limb leads.
Evidence = dict[str, Any]


@dataclass(frozen=True)
class Solvers:
    """solve: the estimate from a start, with the body's turn held or not. lead: an estimate as the limb leads it, if it
    does, and the report of that (see `updated_by_limb`)."""

    solve: Callable[[State, bool], Estimate]
    lead: Callable[[Estimate], tuple[Estimate, Evidence | None]]


@dataclass(frozen=True)
class Orientation:
    """markings: the verdict at the product's orientation. kept: `image` where the joint solution's turn is the
    product's, `prior` where the body stays as predicted. turn_deg: how far the image's solution turned the body.
    gained: how much more evidence the markings give for it than for the predicted orientation. conflict: a doubt."""

    markings: Markings
    kept: str
    turn_deg: float | None = None
    gained: float | None = None
    conflict: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {**self.markings.to_dict(), "kept": self.kept, "turn_deg": self.turn_deg, "gained": self.gained}


def oriented(
    given: Problem, solvers: Solvers, start: State, markings_match: bool, is_held: bool
) -> tuple[Estimate, Evidence | None, Orientation]:
    """The estimate from `start` with the orientation that the image confirms, what the limb said, and the verdict.

    markings_match: False where the markings are already known not to be the map's. is_held: whether the user holds the
    attitude.
    """
    observation, scene, metadata, sigmas = given.observation, given.scene, given.metadata, given.sigmas
    limits = given.thresholds.orientation
    found = solvers.solve(start, is_held)
    estimate, led = solvers.lead(found)
    prior_deg = float(np.max(sigmas[ATTITUDE])) if np.isfinite(sigmas[ATTITUDE]).all() else 10.0
    if np.ptp(scene.basemap.albedo) == 0:
        return with_prior(given, estimate, estimate, is_held), led, Orientation(Markings("no-map"), "prior")
    verdict, texture = markings_and_texture(observation, estimate.state.pose, scene, prior_deg)
    if is_held:
        return estimate, led, Orientation(verdict, "prior")
    if verdict.better_deg is not None:
        elsewhere = estimate.state.moved(step_of(verdict.better_deg), scene.camera)
        if within_prior(elsewhere.pose, metadata.pose, prior_deg):
            found_again = solvers.solve(elsewhere, False)
            again, led_again = solvers.lead(found_again)
            verdict_again, texture_again = markings_and_texture(observation, again.state.pose, scene, prior_deg)
            if verdict_again.verdict == "matched" and (verdict_again.sigmas or 0) > (verdict.sigmas or 0):
                found, estimate, led = found_again, again, led_again
                verdict, texture = verdict_again, texture_again
    turn = turn_between(estimate.state.pose, metadata.pose)
    turn_deg = vector_deg_from_rotation(turn)
    angle = float(np.linalg.norm(turn_deg))
    gain = None
    if texture is not None and verdict.verdict == "matched" and says_more(estimate, sigmas):
        gain = gained(texture, turn)
        doubtful = gain < limits.borne_out and angle > limits.neglected_px * texture.pixel_deg
        if not doubtful or (gain > -no_difference(verdict, limits) and angle <= prior_deg):
            conflict = conflict_of(angle, prior_deg, verdict)
            estimate = with_least_error(estimate, texture, verdict, turn_deg if doubtful else np.zeros(3), limits)
            return estimate, led, Orientation(verdict, "image", angle, gain, conflict)
    predicted = State(estimate.state.pose.replaced(body_from_j2000=metadata.pose.body_from_j2000), start.psf_sigma_px)
    held, led_held = solvers.lead(solvers.solve(predicted, True))
    verdict_there, _ = markings_and_texture(observation, held.state.pose, scene, prior_deg)
    # Two orientations that both fail are no match, and what no flow could follow is none either.
    if not markings_match and verdict_there.verdict == "undetermined":
        verdict_there = replace(verdict_there, verdict="mismatched")
    known = Orientation(verdict_there, "prior", angle, gain)
    if verdict_there.verdict == "mismatched":
        # Markings that are not the image's pull a body that is held at them; one that was free has turned them away.
        # Turned back it has another outline, which the limb leads anew.
        back, led_back = solvers.lead(turned_back(found, metadata.pose))
        return with_prior(given, back, held), led_back, known
    return with_prior(given, held, estimate), led_held, known


def turned_back(estimate: Estimate, predicted: Pose) -> Estimate:
    """The estimate with its body at the predicted orientation; centre, range and roll as they were found."""
    state, free = (
        replace(each, pose=each.pose.replaced(body_from_j2000=predicted.body_from_j2000))
        for each in (estimate.state, estimate.free_state)
    )
    return replace(estimate, state=state, free_state=free)


def markings_and_texture(
    observation: Observation, pose: Pose, scene: Scene, prior_deg: float
) -> tuple[Markings, Texture | None]:
    """The verdict at a pose, and the texture that it is about."""
    texture = texture_of(observation, pose, scene)
    return (Markings("undetermined") if texture is None else compared_markings(texture, prior_deg)), texture


def step_of(turn_deg: Array) -> Array:
    """A turn of the body as a step (8,) of the unknowns."""
    step = np.zeros(ATTITUDE.stop + 1)
    step[ATTITUDE] = turn_deg
    return step


def turn_between(pose: Pose, predicted: Pose) -> Array:
    """The rotation (3, 3), in the body frame of `pose`, that turns its body to the predicted orientation."""
    return np.asarray((predicted.body_from_j2000 @ pose.body_from_j2000.T).T)


def within_prior(pose: Pose, predicted: Pose, prior_deg: float) -> bool:
    """Whether the orientation is one that the prior allows at all."""
    turn = vector_deg_from_rotation(turn_between(pose, predicted))
    return bool(np.linalg.norm(turn) < 2 * CONFLICT_SIGMAS * prior_deg)


def says_more(estimate: Estimate, sigmas: Array) -> bool:
    """Whether the solution knows the orientation better than its prior of 1-sigma `sigmas` (8,), about each axis."""
    return bool((np.sqrt(np.diag(estimate.covariance)[ATTITUDE]) <= sigmas[ATTITUDE]).all())


def no_difference(verdict: Markings, limits: OrientationThresholds) -> float:
    """Differences of evidence that say nothing: chance, and what maps get wrong, which grows with the evidence."""
    return limits.borne_out + limits.same_share * (verdict.sigmas or 0.0) ** 2


def gained(texture: Texture, back: Array) -> float:
    """By how much the evidence at the solution's orientation exceeds that at the predicted one, which the rotation
    `back` (3, 3) leads to."""
    independent = measurements(texture)
    here = evidence_of(texture.correlations(np.eye(3)), independent)
    return here - evidence_of(texture.correlations(back), independent)


def peak_error(markings: Markings) -> float:
    """1-sigma of the place of the correlation's peak, in units of its width: sqrt(1 - r^2) / (r sqrt(n)) of n
    independent measurements that correlate by r; what the map gets wrong of the markings is in r."""
    correlation, independent = markings.correlation or 0.0, markings.independent or 0.0
    if correlation <= 0 or independent <= 0:
        return 0.0
    return float(np.sqrt(max(1 - correlation**2, 0.0) / independent) / correlation)


def with_least_error(
    estimate: Estimate, texture: Texture, markings: Markings, spread_deg: Array, limits: OrientationThresholds
) -> Estimate:
    """The estimate with the orientation's errors that no residual shows, by what the matched `markings` can tell at
    best, and that of `spread_deg` (3,), a rotation vector, along that."""
    pose = estimate.state.pose
    sight = pose.camera_from_body.T @ (pose.target_in_camera_km / pose.range_km)
    pixel_deg, about = texture.pixel_deg / texture.reduction, np.outer(sight, sight)
    across_px = float(np.hypot(limits.across_px, limits.peak_px * peak_error(markings)))
    about_px = across_px * limits.about_px / limits.across_px
    least = np.zeros_like(estimate.covariance)
    least[ATTITUDE, ATTITUDE] = (across_px * pixel_deg) ** 2 * (np.eye(3) - about) + (about_px * pixel_deg) ** 2 * about
    least[ATTITUDE, ATTITUDE] += np.outer(spread_deg, spread_deg)
    return replace(estimate, covariance=estimate.covariance + least, free_covariance=estimate.free_covariance + least)


def with_prior(given: Problem, held: Estimate, free: Estimate, is_held: bool = False) -> Estimate:
    """`held`, solved at the predicted orientation, with that known by its prior; all else is known less well, as far as
    it moved in `free`, solved without holding it, the more the wider the prior is."""
    sigmas, scene, limits = given.sigmas, given.scene, given.thresholds.orientation
    if is_held or not np.isfinite(sigmas[ATTITUDE]).all():
        return held
    moved = difference(free.state, held.state, scene.camera)
    prior_deg, angle = float(np.max(sigmas[ATTITUDE])), float(np.linalg.norm(moved[ATTITUDE]))
    moved *= prior_deg / max(angle, prior_deg / limits.most_stretch)
    moved[ATTITUDE], moved[PSF] = 0, 0
    spread = np.outer(moved, moved) + outline_spread(held.state.pose, scene, prior_deg, limits.fewest_directions)
    spread[ATTITUDE, ATTITUDE] = np.diag(sigmas[ATTITUDE] ** 2)
    return replace(held, covariance=held.covariance + spread, free_covariance=held.free_covariance + spread)


def conflict_of(turn_deg: float, prior_deg: float, verdict: Markings) -> str | None:
    """The doubt that a turn raises which its prior hardly allows, unless the markings support it strongly."""
    if turn_deg <= CONFLICT_SIGMAS * prior_deg or is_borne_out(verdict):
        return None
    return (
        f"{Reason.ORIENTATION_CONFLICT}: "
        f"the image turns the body by {turn_deg:.1f} deg, which is known to {prior_deg:g} deg "
        f"(1 sigma), and its markings support that by only {verdict.sigmas:.1f} sigmas. Check body_from_j2000."
    )


def doubt_of_markings(orientation: Orientation) -> str | None:
    """The doubt that markings raise which are not where the orientation has them."""
    if orientation.markings.verdict != "mismatched":
        return orientation.conflict
    return mismatch_of(orientation.markings)
