"""The cross-check of every joint solution against the limb; where the two contradict each other, the limb leads.

The joint solution rests on map and photometric laws. Where they do not fit the body (an old map, haze, light that the
vidicon smears) all pixels together may outvote the limb. The limb's own edges do not depend on them, and neither does
the trajectory's range: both are compared with the solution, by their errors. Where they contradict it, the limb's edges
are weighed in as an observation of centre and range, and the joint solution's error is taken to be as large as the
contradiction shows it to be; attitude and roll follow by their correlation with centre and range.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.errors import FailedError
from catalog.reasons import Reason
from tasks.joint.coarse_to_fine import Estimate, with_range_prior
from tasks.joint.contradiction import chi_square, growth_of
from tasks.joint.limb_observation import OBSERVED, LimbObservation, limb_observation, shown_by
from tasks.joint.parameters import OFFSET, RANGE, difference, with_psf_within
from tasks.joint.problem import Problem
from tasks.joint.pyramid import Level

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Witnesses:
    """What contradicts or confirms a solution `own` (8, 8) known: the limb's step (3,) from it with covariance (3, 3),
    and the trajectory's (of the range), with its variance; inf where it says nothing. chance: of a
    difference that is a contradiction."""

    own: Array
    limb: LimbObservation
    range_step: float
    range_variance: float
    chance: float

    @property
    def trusted_range(self) -> bool:
        """Whether there is a trajectory's range that the limb does not contradict: where the two disagree the target or
        its range is another, which says nothing against the solution."""
        if not np.isfinite(self.range_variance):
            return False
        away = self.limb.step[RANGE] - self.range_step
        return bool(away**2 <= chi_square(1, self.chance) * (self.limb.covariance[RANGE, RANGE] + self.range_variance))

    def system(self) -> tuple[Array, Array, Array]:
        """The solution's covariance in what is observed, the observations' own, and the differences (n,)."""
        places = [0, 1, RANGE]
        if not self.trusted_range:
            return self.own[OBSERVED, OBSERVED], self.limb.covariance, self.limb.step
        places = [*places, RANGE]
        others = np.zeros((4, 4))
        others[OBSERVED, OBSERVED], others[3, 3] = self.limb.covariance, self.range_variance
        return self.own[np.ix_(places, places)], others, np.array([*self.limb.step, self.range_step])

    @property
    def contradict(self) -> bool:
        """Whether they contradict the solution by more than CHANCE allows."""
        own, others, wanted = self.system()
        return bool(wanted @ np.linalg.solve(own + others, wanted) > chi_square(len(wanted), self.chance))

    def growth(self) -> float:
        """By what factor the solution's covariance must grow so that they do not."""
        return growth_of(*self.system())


def updated_by_limb(given: Problem, estimate: Estimate) -> tuple[Estimate, dict[str, Any] | None]:
    """The estimate, and None; or, where the limb and the trajectory contradict it, or its product's limb is more than
    `settings.limb_led_px` off, one that the limb leads, and what is said of it. An estimate that holds centre or range
    stays. What is said has a `doubt` where limb and product disagree all the same."""
    settings, scene, limits = given.settings, given.scene, given.thresholds.contradiction
    limit = settings.limb_led_px
    if limit is None or estimate.free.held[OBSERVED].any():
        return estimate, None
    # One law's error of brightness near the limb would move the rendered edges.
    mixed = replace(scene, settings=scene.settings.model_copy(update={"photometry": "mixture"}))
    level = Level.of(replace(given, scene=mixed), estimate.state, settings.diameter_px)
    pulled = difference(estimate.state, estimate.free_state, scene.camera)
    try:
        limb, edges_px = shown_by(estimate.free, level, pulled)
        if edges_px <= limit and not witnesses(given, estimate, limb).contradict:
            return estimate, None
        before = limb_observation(level, estimate.state, limits.limb_sky_px)
        # The trajectory may hold the product farther from the free solution than one linear step of the limb reaches.
        near = before.rms_px <= limit
        free = before.after(-pulled) if near else limb_observation(level, estimate.free_state, limits.limb_sky_px)
        seen = witnesses(given, estimate, free)
        if near and not seen.contradict:
            return estimate, None
        led, grown = limb_filter(given, level, estimate, seen)
        led = with_range_prior(led, given)
        after = limb_observation(level, led.state, limits.limb_sky_px)
        if not fits_better(after, before, limits.chance):
            # It leads nowhere: the solution stays, its errors as large as the contradiction.
            grown = seen.growth()
            led = with_range_prior(replace(estimate, free_covariance=grown * seen.own + estimate.common), given)
            after = before
        sure = led.covariance
        if after is not before:
            led = with_the_other(led, estimate, scene.camera, limits.led_wrong)
    except FailedError:
        return estimate, None
    moved = difference(led.state, estimate.state, scene.camera)
    evidence = {"limb_px": [before.rms_px, after.rms_px], "moved_px": moved[OFFSET].tolist(), "error_grown": grown**0.5}
    if doubt := doubt_of_limb(after, sure, limits.chance_doubted):
        evidence["doubt"] = doubt
    return led, evidence


def with_the_other(led: Estimate, estimate: Estimate, camera: Camera, wrong: float) -> Estimate:
    """What the limb led, known only as well as two answers are of which the one that was taken is wrong with
    probability `wrong`: the variance of their mixture, along what lies between them."""
    share = wrong * (1 - wrong)
    free, product = (
        difference(a, b, camera) for a, b in ((led.free_state, estimate.free_state), (led.state, estimate.state))
    )
    return replace(
        led,
        free_covariance=led.free_covariance + share * np.outer(free, free),
        covariance=led.covariance + share * np.outer(product, product),
    )


def fits_better(after: LimbObservation, before: LimbObservation, chance: float) -> bool:
    """Whether the limb lies nearer by more than chance explains: what its squares are less, by those that are left for
    each part that errs on its own, three unknowns having been led."""
    gain = (before.rms_px**2 - after.rms_px**2) / max(after.rms_px**2, 1e-12)
    return bool(gain * after.independent > chi_square(len(after.step), chance))


def witnesses(given: Problem, estimate: Estimate, limb: LimbObservation) -> Witnesses:
    """Limb, as seen from the free solution, and trajectory as witnesses of the estimate. Errors that limb and pixels
    share, such as the body's radius, are between them and the trajectory."""
    own = estimate.free_covariance - estimate.common
    wanted = -float(difference(estimate.free_state, given.metadata, given.scene.camera)[RANGE])
    variance = float(given.sigmas[RANGE] ** 2 + estimate.common[RANGE, RANGE])
    return Witnesses(own, limb, wanted, variance, given.thresholds.contradiction.chance)


def doubt_of_limb(limb: LimbObservation, covariance: Array, chance: float) -> str | None:
    """Whether the product, of covariance (8, 8), is not where the limb is."""
    away = float(limb.step @ np.linalg.solve(limb.covariance + covariance[OBSERVED, OBSERVED], limb.step))
    if away <= chi_square(len(limb.step), chance):
        return None
    x, y, growth = limb.step
    return (
        f"{Reason.LIMB_AND_INTERIOR_DISAGREE}: "
        f"the image's limb puts the centre ({x:+.2f}, {y:+.2f}) px away from the "
        f"solution's and a range factor of {np.exp(growth):.5f}, {np.sqrt(away):.1f} times their errors. "
        "Check the base map, the target and the picture; --profile standard trusts the limb alone."
    )


def limb_filter(given: Problem, level: Level, estimate: Estimate, seen: Witnesses) -> tuple[Estimate, float]:
    """The limb as an observation of centre and range (one step of a Kalman filter, measured anew where it leads), with
    the estimate's own covariance grown so far that it contradicts none of the witnesses; and by what factor it was
    grown."""
    camera, own, limits = given.scene.camera, seen.own, given.thresholds.contradiction
    state, grown, errors = estimate.free_state, 1.0, own
    for number in range(1, limits.limb_rounds + 1):
        wanted = seen.limb.step
        grown = seen.growth()
        gain = grown * own[:, OBSERVED] @ np.linalg.inv(grown * own[OBSERVED, OBSERVED] + seen.limb.covariance)
        errors = grown * own - gain @ (grown * own[OBSERVED])
        step = with_psf_within(gain @ wanted, given.thresholds.iteration.largest_psf)
        moved = difference(estimate.free_state.moved(step, camera), state, camera)
        state = estimate.free_state.moved(step, camera)
        if given.progress:
            given.progress("limb", number, f"{seen.limb.rms_px:.2f} px off, moved {np.hypot(*moved[OFFSET]):.3f} px")
        if np.hypot(*moved[OFFSET]) < limits.limb_still_px or number == limits.limb_rounds:
            break
        limb = limb_observation(level, state, limits.limb_sky_px)
        seen = witnesses(given, estimate, limb.after(difference(estimate.free_state, state, camera)))
    return replace(estimate, free_state=state, free_covariance=errors + estimate.common), grown
