"""The cross-check of every joint solution against the limb; where the two contradict each other, the limb leads.

The joint solution rests on map and photometric laws. Where they do not fit the body (an old map, haze, light that the
vidicon smears) all pixels together may outvote the limb. The limb's own edges do not depend on them, and neither does
the trajectory's range: both are compared with the solution, by their errors. Where they contradict it, the limb's edges
are weighed in as an observation of centre and range, and the joint solution's error is taken to be as large as the
contradiction shows it to be; attitude and roll follow by their correlation with centre and range.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.errors import FailedError
from catalog.observation import Observation
from tasks.joint.contradiction import chi_square, growth_of
from tasks.joint.estimate import Estimate, weighed
from tasks.joint.limb_seen import TOLD, LimbAsks, asked, shown_by
from tasks.joint.parameters import OFFSET, RANGE, State, difference
from tasks.joint.scale import Scale
from tasks.joint.settings import JointSettings
from tasks.simulate import Scene

Array = NDArray[np.float64]
Progress = Callable[[str, int, str], None]

ROUNDS, STILL_PX = 4, 0.03
# Chance of a difference between product and limb, with the errors of both grown, that is doubted.
CHANCE_DOUBTED = 1e-4
# How often the limb that leads is the one that is wrong, by relief or by optics that are in no file: of five simulated
# images of another renderer that it led, it led two away from the truth. A choice between that and never.
LED_WRONG = 0.25


@dataclass(frozen=True)
class Witnesses:
    """What contradicts or confirms a solution `own` (8, 8) known: the limb's step (3,) from it with covariance (3, 3),
    and the trajectory's (of the range), with its variance; inf where it says nothing."""

    own: Array
    limb: LimbAsks
    range_step: float
    range_variance: float

    @property
    def trusted_range(self) -> bool:
        """Whether there is a trajectory's range that the limb does not contradict: where the two disagree the target or
        its range is another, which says nothing against the solution."""
        if not np.isfinite(self.range_variance):
            return False
        away = self.limb.step[RANGE] - self.range_step
        return bool(away**2 <= chi_square(1) * (self.limb.covariance[RANGE, RANGE] + self.range_variance))

    def system(self) -> tuple[Array, Array, Array]:
        """The solution's covariance in what is observed, the observations' own, and the differences (n,)."""
        places = [0, 1, RANGE]
        if not self.trusted_range:
            return self.own[TOLD, TOLD], self.limb.covariance, self.limb.step
        places = [*places, RANGE]
        others = np.zeros((4, 4))
        others[TOLD, TOLD], others[3, 3] = self.limb.covariance, self.range_variance
        return self.own[np.ix_(places, places)], others, np.array([*self.limb.step, self.range_step])

    @property
    def contradict(self) -> bool:
        """Whether they contradict the solution by more than CHANCE allows."""
        own, others, wanted = self.system()
        return bool(wanted @ np.linalg.solve(own + others, wanted) > chi_square(len(wanted)))

    def growth(self) -> float:
        """By what factor the solution's covariance must grow so that they do not."""
        return growth_of(*self.system())


def led_by_limb(
    observation: Observation,
    estimate: Estimate,
    metadata: State,
    sigmas: Array,
    scene: Scene,
    settings: JointSettings,
    progress: Progress | None = None,
) -> tuple[Estimate, dict[str, Any] | None]:
    """The estimate, and None; or, where the limb and the trajectory contradict it, or its product's limb is more than
    `settings.limb_led_px` off, one that the limb leads, and what is told of it. An estimate that holds centre or range
    stays. What is told has a `doubt` where limb and product disagree all the same."""
    limit = settings.limb_led_px
    if limit is None or estimate.free.held[TOLD].any():
        return estimate, None
    # One law's error of brightness near the limb would move the rendered edges.
    mixed = replace(scene, settings=scene.settings.model_copy(update={"photometry": "mixture"}))
    scale = Scale.of(observation, mixed, estimate.state, settings.diameter_px)
    pulled = difference(estimate.state, estimate.free_state, scene.camera)
    try:
        limb, edges_px = shown_by(estimate.free, scale, pulled)
        if edges_px <= limit and not witnesses(estimate, limb, metadata, sigmas, scene.camera).contradict:
            return estimate, None
        before = asked(scale, estimate.state)
        # The trajectory may hold the product farther from the free solution than one linear step of the limb reaches.
        free = before.after(-pulled) if before.rms_px <= limit else asked(scale, estimate.free_state)
        seen = witnesses(estimate, free, metadata, sigmas, scene.camera)
        if before.rms_px <= limit and not seen.contradict:
            return estimate, None
        led, grown = weighed_in(scale, estimate, seen, metadata, sigmas, scene, progress)
        led = weighed(led, metadata, sigmas, scene.camera)
        after = asked(scale, led.state)
        if not fits_better(after, before):
            # It leads nowhere: the solution stays, its errors as large as the contradiction.
            grown = seen.growth()
            grown_errors = grown * seen.own + estimate.common
            led = weighed(replace(estimate, free_covariance=grown_errors), metadata, sigmas, scene.camera)
            after = before
        sure = led.covariance
        if after is not before:
            led = with_the_other(led, estimate, scene.camera)
    except FailedError:
        return estimate, None
    moved = difference(led.state, estimate.state, scene.camera)
    told = {"limb_px": [before.rms_px, after.rms_px], "moved_px": moved[OFFSET].tolist(), "error_grown": grown**0.5}
    if doubt := doubt_of_limb(after, sure):
        told["doubt"] = doubt
    return led, told


def with_the_other(led: Estimate, estimate: Estimate, camera: Camera) -> Estimate:
    """What the limb led, known only as well as two answers are of which the one that was taken is wrong with
    probability LED_WRONG: the variance of their mixture, along what lies between them."""
    share = LED_WRONG * (1 - LED_WRONG)
    free, product = (
        difference(a, b, camera) for a, b in ((led.free_state, estimate.free_state), (led.state, estimate.state))
    )
    return replace(
        led,
        free_covariance=led.free_covariance + share * np.outer(free, free),
        covariance=led.covariance + share * np.outer(product, product),
    )


def fits_better(after: LimbAsks, before: LimbAsks) -> bool:
    """Whether the limb lies nearer by more than chance explains: what its squares are less, by those that are left for
    each part that errs on its own, three unknowns having been led."""
    gain = (before.rms_px**2 - after.rms_px**2) / max(after.rms_px**2, 1e-12)
    return bool(gain * after.independent > chi_square(len(after.step)))


def witnesses(estimate: Estimate, limb: LimbAsks, metadata: State, sigmas: Array, camera: Camera) -> Witnesses:
    """Limb, asking from the free solution, and trajectory as witnesses of the estimate. Errors that limb and pixels
    share, such as the body's radius, are between them and the trajectory."""
    own = estimate.free_covariance - estimate.common
    wanted = -float(difference(estimate.free_state, metadata, camera)[RANGE])
    return Witnesses(own, limb, wanted, float(sigmas[RANGE] ** 2 + estimate.common[RANGE, RANGE]))


def doubt_of_limb(limb: LimbAsks, covariance: Array) -> str | None:
    """Whether the product, of covariance (8, 8), is not where the limb is."""
    away = float(limb.step @ np.linalg.solve(limb.covariance + covariance[TOLD, TOLD], limb.step))
    if away <= chi_square(len(limb.step), CHANCE_DOUBTED):
        return None
    x, y, growth = limb.step
    return (
        f"limb-and-interior-disagree: the image's limb asks for a centre ({x:+.2f}, {y:+.2f}) px away from the "
        f"solution's and a range factor of {np.exp(growth):.5f}, {np.sqrt(away):.1f} times their errors. "
        "Check the base map, the target and the picture; --profile standard trusts the limb alone."
    )


def weighed_in(
    scale: Scale,
    estimate: Estimate,
    seen: Witnesses,
    metadata: State,
    sigmas: Array,
    scene: Scene,
    progress: Progress | None,
) -> tuple[Estimate, float]:
    """The limb as an observation of centre and range (one step of a Kalman filter, measured anew where it leads), with
    the estimate's own covariance grown so far that it contradicts none of the witnesses; and by what factor it was
    grown."""
    camera, own = scene.camera, seen.own
    state, grown, errors = estimate.free_state, 1.0, own
    for number in range(1, ROUNDS + 1):
        wanted = seen.limb.step
        grown = seen.growth()
        gain = grown * own[:, TOLD] @ np.linalg.inv(grown * own[TOLD, TOLD] + seen.limb.covariance)
        errors = grown * own - gain @ (grown * own[TOLD])
        moved = difference(estimate.free_state.moved(gain @ wanted, camera), state, camera)
        state = estimate.free_state.moved(gain @ wanted, camera)
        if progress:
            progress("limb", number, f"{seen.limb.rms_px:.2f} px off, moved {np.hypot(*moved[OFFSET]):.3f} px")
        if np.hypot(*moved[OFFSET]) < STILL_PX or number == ROUNDS:
            break
        limb = asked(scale, state).after(difference(estimate.free_state, state, camera))
        seen = witnesses(estimate, limb, metadata, sigmas, camera)
    return replace(estimate, free_state=state, free_covariance=errors + estimate.common), grown
