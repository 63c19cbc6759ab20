"""Where brightness and markings put the limb elsewhere than the image shows it, the limb leads.

The joint solution rests on map and photometric laws. Where they do not fit the body (an old map, haze, light that the
vidicon smears) all pixels together may outvote the limb. The limb's own edges do not depend on them: then they are
weighed in as an observation of centre and range, and the joint solution's error is taken to be as large as the
contradiction shows it to be; attitude and roll follow by their correlation with centre and range.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.observation import Observation
from tasks.compare.limb_edges import LimbEdges, LimbSettings, edges_between, measure_limb
from tasks.compare.limb_fit import HUBER, fit_limb
from tasks.compare.match import Match, framed_window, match_scene
from tasks.joint.estimate import Estimate, weighed
from tasks.joint.parameters import NAMES, OFFSET, State, difference
from tasks.joint.scale import Scale
from tasks.joint.settings import JointSettings
from tasks.simulate import Scene, Simulation

Array = NDArray[np.float64]
Progress = Callable[[str, int, str], None]

EDGES = LimbSettings()
SKY_PX = 16.0
# Centre and range: what the limb tells.
TOLD = slice(0, 3)
ROUNDS, STILL_PX = 4, 0.03
# The quick look is at the solution with the range free, which may lie nearer than the product.
QUICK_SHARE = 2 / 3
# Lengths of limb over which segments may err together, degrees; the one that shows most of it counts.
ARCS_DEG = (2, 4, 8, 12, 16, 20, 30)
# Whatever their scatter, by so much do edges err together along an arc of the largest length: blur, laws, markings.
EDGE_PX = 0.05


@dataclass(frozen=True)
class LimbAsks:
    """step (3,) of centre and range that the limb asks for, its covariance (3, 3), and how far (px, RMS along the
    segments) it lies now."""

    step: Array
    covariance: Array
    rms_px: float


def led_by_limb(
    observation: Observation,
    estimate: Estimate,
    metadata: State,
    sigmas: Array,
    scene: Scene,
    settings: JointSettings,
    progress: Progress | None = None,
) -> tuple[Estimate, dict[str, Any] | None]:
    """The estimate, and None; or, where its limb is more than `settings.limb_led_px` off, one that the limb leads, and
    what is told of it. An estimate that holds centre or range stays."""
    limit = settings.limb_led_px
    # One law's error of brightness near the limb would move the rendered edges.
    mixed = replace(scene, settings=scene.settings.model_copy(update={"photometry": "mixture"}))
    scale = Scale.of(observation, mixed, estimate.state, settings.diameter_px)
    if limit is None or estimate.free.held[TOLD].any() or not is_suspect(estimate, scale, limit):
        return estimate, None
    try:
        before = asked(scale, estimate.state).rms_px
        if before <= limit:
            return estimate, None
        led, conflict = weighed_in(scale, estimate, scene, progress)
        led = weighed(led, metadata, sigmas, scene.camera)
        after = asked(scale, led.state).rms_px
    except FailedError:
        return estimate, None
    if after >= before:
        return estimate, None
    moved = difference(led.state, estimate.state, scene.camera)
    told = {"limb_px": [before, after], "moved_px": moved[OFFSET].tolist(), "error_grown": float(np.sqrt(conflict))}
    return led, told


def is_suspect(estimate: Estimate, scale: Scale, limit_px: float) -> bool:
    """Whether the solution's own picture has its limb nearly that far off, without the tiles that may hide it: a quick
    look that renders nothing."""
    solution = estimate.free
    model, fit, problem = solution.model, solution.fit, solution.problem
    linear = slice(0, len(problem.columns) - len(NAMES))
    picture = np.tensordot(fit.values[linear].astype(np.float32), problem.columns[linear], 1).astype(np.float64)
    lit, psf = (model.mu0 > 0).astype(np.float32), solution.state.psf_sigma_px
    drawn = Simulation(model.window, model.oversample, psf, model.bases, model.bases, model.coverage, lit)
    edges = edges_between(Match(problem.image, fit.weight, drawn, solution.state.pose, scale.scene), picture, EDGES)
    enough = len(edges.shift_px) >= EDGES.min_points
    return enough and bool(scale.n * np.sqrt(np.mean(edges.shift_px**2)) > QUICK_SHARE * limit_px)


def asked(scale: Scale, state: State) -> LimbAsks:
    """What the limb asks of `state`, in pixels of the image. Raises FailedError when too few segments are measured."""
    scene = scale.scene
    window = framed_window(scene, state.pose, margin_px=SKY_PX)
    edges = measure_limb(match_scene(scale.observation, scene, state.pose, window), EDGES)
    found = asked_by(edges, scene.camera.project(state.pose.target_in_camera_km))
    unit = np.array([scale.n, scale.n, 1.0])
    return LimbAsks(unit * found.step, found.covariance * np.outer(unit, unit), scale.n * found.rms_px)


def asked_by(edges: LimbEdges, centre_px: Array) -> LimbAsks:
    """Robust fit of centre and range to the edges, with the covariance of segments that err together along arcs."""
    found = fit_limb(edges, centre_px, solve_growth=True, min_points=EDGES.min_points)
    normal, away = edges.segments.normal, edges.segments.xy_px - centre_px
    rho = np.einsum("ij,ij->i", away, normal)
    design = np.column_stack([normal, -rho])
    step = np.array([*found.offset_px, -found.growth])
    residual = edges.across_px - design @ step
    weight = np.minimum(1.0, HUBER * found.residual_px / np.maximum(np.abs(residual), 1e-12))
    kept = weight * residual
    angle_deg = np.degrees(np.arctan2(away[:, 1], away[:, 0])) % 360
    together = shared_along(kept, angle_deg)
    variance = max(float(kept @ kept) / max(len(kept) - 3, 1) * together, EDGE_PX**2 * segments_per_arc(angle_deg))
    covariance = np.linalg.pinv((design * weight[:, None]).T @ design, hermitian=True) * variance
    return LimbAsks(step, covariance, float(np.sqrt(np.mean(edges.shift_px**2))))


def shared_along(residual: Array, angle_deg: Array) -> float:
    """How many neighbouring segments err together: the largest mean square of sums over arcs, by the sum of squares."""
    squares = max(float(residual @ residual), 1e-300)
    sums = (np.bincount((angle_deg // arc).astype(np.int64), residual) for arc in ARCS_DEG)
    return max(1.0, *(float(s @ s) / squares for s in sums))


def segments_per_arc(angle_deg: Array) -> float:
    """How many segments the longest of the arcs holds, where there are any."""
    counts = np.bincount((angle_deg // ARCS_DEG[-1]).astype(np.int64))
    return float(counts[counts > 0].mean())


def weighed_in(scale: Scale, estimate: Estimate, scene: Scene, progress: Progress | None) -> tuple[Estimate, float]:
    """The limb as an observation of centre and range (one step of a Kalman filter, measured anew where it leads), with
    the estimate's own covariance grown so far that the two agree; and by what factor it was grown."""
    camera, state, own = scene.camera, estimate.free_state, estimate.free_covariance - estimate.common
    grown, errors = 1.0, own
    for number in range(1, ROUNDS + 1):
        limb = asked(scale, state)
        wanted = difference(state, estimate.free_state, camera)[TOLD] + limb.step
        grown = growth_of(own[TOLD, TOLD], limb.covariance, wanted)
        gain = grown * own[:, TOLD] @ np.linalg.inv(grown * own[TOLD, TOLD] + limb.covariance)
        errors = grown * own - gain @ (grown * own[TOLD])
        moved = difference(estimate.free_state.moved(gain @ wanted, camera), state, camera)
        state = estimate.free_state.moved(gain @ wanted, camera)
        if progress:
            progress("limb", number, f"{limb.rms_px:.2f} px off, moved {np.hypot(*moved[OFFSET]):.3f} px")
        if np.hypot(*moved[OFFSET]) < STILL_PX:
            break
    return replace(estimate, free_state=state, free_covariance=errors + estimate.common), grown


def growth_of(own: Array, limb: Array, wanted: Array) -> float:
    """The least factor, 1 or more, on the covariance `own` (3, 3) with which a difference `wanted` (3,) from the limb's
    place, of covariance `limb`, is no surprise: its weighted square is the number of unknowns."""
    from scipy.optimize import brentq

    def surprise(log_factor: float) -> float:
        return float(wanted @ np.linalg.solve(np.exp(log_factor) * own + limb, wanted)) - len(wanted)

    most = np.log(1e6)
    if surprise(0.0) <= 0:
        return 1.0
    return float(np.exp(brentq(surprise, 0.0, most, xtol=1e-3))) if surprise(most) < 0 else 1e6
