"""Where brightness and markings put the limb elsewhere than the image shows it, the limb leads.

The joint solution rests on map and photometric laws. Where they do not fit the body (an old map, haze, light that the
vidicon smears) all pixels together may outvote the limb. The limb's own edges do not depend on them: then they are
weighed in as an observation of centre and range, and the joint solution's error is taken to be as large as the
contradiction shows it to be. What the image tells beyond that (attitude, roll) is found again with centre and range
held there.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import FailedError
from catalog.observation import Observation
from tasks.compare.limb_edges import LimbEdges, LimbSettings, measure_limb
from tasks.compare.limb_fit import HUBER, fit_limb
from tasks.compare.match import framed_window, match_scene
from tasks.joint.estimate import Estimate, coarse, solved_at, weighed
from tasks.joint.parameters import OFFSET, State, difference
from tasks.joint.scale import Scale
from tasks.joint.settings import JointSettings
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]
Progress = Callable[[str, int, str], None]

EDGES = LimbSettings()
SKY_PX = 16.0
# Centre and range: what the limb tells.
TOLD = slice(0, 3)
ROUNDS, STILL_PX = 4, 0.03
# Lengths of limb over which segments may err together, degrees; the one that shows most of it counts.
ARCS_DEG = (2, 4, 8, 12, 16, 20, 30)
# 1-sigma of the edges themselves, px: what blur and law leave of them.
EDGE_PX = 0.02
SETTLING_ITERATIONS = 5


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
    if limit is None or estimate.free.held[TOLD].any() or not is_suspect(estimate, scene, limit):
        return estimate, None
    try:
        before = asked(observation, estimate.state, scene).rms_px
        if before <= limit:
            return estimate, None
        led, conflict = weighed_in(observation, estimate, scene, progress)
        led = settled(observation, led, estimate, metadata, sigmas, scene, settings)
        after = asked(observation, led.state, scene).rms_px
    except FailedError:
        return estimate, None
    if after >= before:
        return estimate, None
    moved = difference(led.state, estimate.state, scene.camera)
    told = {"limb_px": [before, after], "moved_px": moved[OFFSET].tolist(), "error_grown": float(np.sqrt(conflict))}
    return led, told


def is_suspect(estimate: Estimate, scene: Scene, limit_px: float) -> bool:
    """Whether the residuals along the limb look as if edges lay half of `limit_px` off: a quick look, without rendering."""
    problem, fit, model = estimate.free.problem, estimate.free.fit, estimate.free.model
    n = 2 * disk_radius_px(estimate.free_state.pose, scene.camera, scene.target) / (2 * model.tiles.radius_px)
    ring = (model.tiles.label >= 0) & (model.tiles.label < model.tiles.sectors) & (fit.weight > 0)
    fall = radial_fall(model.brightness(fit.values[: len(model.bases)]), model.centre_px)
    steep = ring & (fall > 0.3 * np.percentile(fall[ring], 99)) if ring.any() else ring
    if not steep.any():
        return False
    shifts = sector_shifts(fit.residual[steep], fall[steep], model.tiles.label[steep])
    return bool(n * np.sqrt(np.mean(shifts**2)) > limit_px / 2)


def sector_shifts(residual: Array, fall: Array, sector: NDArray[np.int32]) -> Array:
    """Least-squares shift of every sector's edge, outward, px."""
    top = np.bincount(sector, residual * fall)
    below = np.bincount(sector, fall * fall)
    return np.asarray(top[below > 0] / below[below > 0])


def radial_fall(bright: NDArray[np.float32], centre_px: Array) -> Array:
    """How fast (ny, nx) brightness falls outward, per pixel."""
    gradient_y, gradient_x = np.gradient(bright.astype(np.float64))
    y, x = np.indices(bright.shape)
    x, y = x - centre_px[0], y - centre_px[1]
    return np.asarray(-(gradient_x * x + gradient_y * y) / np.maximum(np.hypot(x, y), 1.0))


def asked(observation: Observation, state: State, scene: Scene) -> LimbAsks:
    """What the limb asks of `state`. Raises FailedError when too few segments are measured."""
    window = framed_window(scene, state.pose, margin_px=SKY_PX)
    edges = measure_limb(match_scene(observation, scene, state.pose, window), EDGES)
    return asked_by(edges, scene.camera.project(state.pose.target_in_camera_km))


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
    together = shared_along(kept, np.degrees(np.arctan2(away[:, 1], away[:, 0])) % 360)
    variance = float(kept @ kept) / max(len(kept) - 3, 1) * together
    covariance = np.linalg.pinv((design * weight[:, None]).T @ design, hermitian=True) * variance
    covariance += np.diag(np.square([EDGE_PX, EDGE_PX, EDGE_PX / np.sqrt(np.mean(rho**2))]))
    return LimbAsks(step, covariance, float(np.sqrt(np.mean(edges.shift_px**2))))


def shared_along(residual: Array, angle_deg: Array) -> float:
    """How many neighbouring segments err together: the largest mean square of sums over arcs, by the sum of squares."""
    squares = max(float(residual @ residual), 1e-300)
    sums = (np.bincount((angle_deg // arc).astype(np.int64), residual) for arc in ARCS_DEG)
    return max(1.0, *(float(s @ s) / squares for s in sums))


def weighed_in(
    observation: Observation, estimate: Estimate, scene: Scene, progress: Progress | None
) -> tuple[Estimate, float]:
    """The limb as an observation of centre and range (one step of a Kalman filter, measured anew where it leads), with
    the estimate's own covariance grown so far that the two agree; and by what factor it was grown."""
    camera, state, own = scene.camera, estimate.free_state, estimate.free_covariance - estimate.common
    grown, errors = 1.0, own
    for number in range(1, ROUNDS + 1):
        limb = asked(observation, state, scene)
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
    """The least factor, 1 or more, on the covariance `own` (3, 3) with which a difference `wanted` (3,) from the limb's,
    of covariance `limb`, is no surprise: its weighted square is the number of unknowns."""
    from scipy.optimize import brentq

    def surprise(log_factor: float) -> float:
        return float(wanted @ np.linalg.solve(np.exp(log_factor) * own + limb, wanted)) - len(wanted)

    most = np.log(1e6)
    if surprise(0.0) <= 0:
        return 1.0
    return float(np.exp(brentq(surprise, 0.0, most, xtol=1e-3))) if surprise(most) < 0 else 1e6


def settled(
    observation: Observation,
    led: Estimate,
    estimate: Estimate,
    metadata: State,
    sigmas: Array,
    scene: Scene,
    settings: JointSettings,
) -> Estimate:
    """`led` with attitude and roll found again while centre and range are held, weighed against the trajectory."""
    hold = tuple({*settings.hold, "offset", "range", "psf"})
    again = coarse(settings).model_copy(update={"hold": hold, "max_iterations": SETTLING_ITERATIONS})
    scale = Scale.of(observation, scene, led.free_state, settings.first_diameter_px)
    found = scale.up(solved_at(scale, led.free_state, metadata, again, sigmas).state)
    step = difference(found, led.free_state, scene.camera)
    step[TOLD] = 0
    state = led.free_state.moved(step, scene.camera)
    return weighed(replace(led, free_state=state), metadata, sigmas, scene.camera)
