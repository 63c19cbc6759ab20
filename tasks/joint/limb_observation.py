"""What the limb's own edges ask of a solution of the joint step: a step of centre and range."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tasks.compare.limb_edges import LimbEdges, LimbSettings, edges_between, measure_limb
from tasks.compare.limb_errors import coherent_px, most_coherent_px, shared_along
from tasks.compare.limb_fit import fit_limb
from tasks.compare.match import Match, framed_window, match_scene
from tasks.joint.displaced_markings import UNSEEN, terms
from tasks.joint.gauss_newton import Solution
from tasks.joint.parameters import NAMES, State
from tasks.joint.pyramid import Level
from tasks.simulate import Simulation

Array = NDArray[np.float64]

EDGES = LimbSettings()
# Centre and range: what the limb shows.
OBSERVED = slice(0, 3)


@dataclass(frozen=True)
class LimbObservation:
    """step (3,) of centre and range that the limb measures, its covariance (3, 3), how far (px, RMS along the segments)
    it lies now, by how much whole arcs of it lie off after the step (see `coherent_px`), how many parts of it err on
    their own, and how large the terms of a displacement (`displaced_markings.terms`) may be, 1-sigma, that leaves no
    more of the limb off than is."""

    step: Array
    covariance: Array
    rms_px: float
    coherent_px: float = 0.0
    independent: float = 18.0
    largest_term_px: float = np.inf

    def after(self, moved: Array) -> "LimbObservation":
        """The same from a state that is `moved` (8,) away; how far the limb then lies is not known."""
        return replace(self, step=self.step - moved[OBSERVED])


def shown_by(solution: Solution, level: Level, moved: Array) -> tuple[LimbObservation, float]:
    """What the limb measures from the solution by the solution's own picture, without the tiles that may hide it: a
    quick look that renders nothing. With it how far (px, RMS) the limb of a state lies that is `moved` (8,) from it."""
    model, fit, problem = solution.model, solution.fit, solution.problem
    linear = slice(0, len(problem.columns) - len(NAMES))
    picture = np.tensordot(fit.values[linear].astype(np.float32), problem.columns[linear], 1).astype(np.float64)
    drawn = Simulation(
        model.window,
        model.oversample,
        solution.state.psf_sigma_px,
        model.bases,
        model.coverage,
        draw_shading=lambda: model.bases[: len(model.bases) - model.hides],
        draw_lit=lambda: (model.mu0 > 0).astype(np.float32),
        hides=model.hides,
    )
    match = Match(problem.image, fit.weight, drawn, solution.state.pose, level.scene, solution.data.clear)
    edges = edges_between(match, picture, EDGES)
    centre = level.scene.camera.project(solution.state.pose.target_in_camera_km)
    unit = np.array([level.n, level.n, 1.0])
    left = edges.across_px - design_of(edges, centre) @ (moved[OBSERVED] / unit)
    along = np.where(edges.segments.horizontal, edges.segments.normal[:, 0], edges.segments.normal[:, 1])
    return in_image(observation_of_edges(edges, centre), level), level.n * float(np.sqrt(np.mean((left / along) ** 2)))


def in_image(found: LimbObservation, level: Level) -> LimbObservation:
    """What was found at a level, in pixels of the image."""
    unit = np.array([level.n, level.n, 1.0])
    covariance = found.covariance * np.outer(unit, unit)
    return LimbObservation(
        unit * found.step,
        covariance,
        level.n * found.rms_px,
        level.n * found.coherent_px,
        found.independent,
        level.n * found.largest_term_px,
    )


def limb_observation(level: Level, state: State, sky_px: float) -> LimbObservation:
    """What the limb measures from `state`, in pixels of the image. Raises FailedError when too few segments are
    measured."""
    scene = level.scene
    window = framed_window(scene, state.pose, margin_px=sky_px)
    edges = measure_limb(match_scene(level.observation, scene, state.pose, window), EDGES)
    return in_image(observation_of_edges(edges, scene.camera.project(state.pose.target_in_camera_km)), level)


def observation_of_edges(edges: LimbEdges, centre_px: Array) -> LimbObservation:
    """Robust fit of centre and range to the edges. Raises FailedError when there are too few."""
    away = np.linalg.norm(edges.segments.xy_px - centre_px, axis=1)
    needed = EDGES.points_needed(float(np.median(away)) if len(away) else 0.0)
    found = fit_limb(edges, centre_px, solve_growth=True, min_points=needed)
    # A disk that grows is nearer.
    sign = np.array([1.0, 1.0, -1.0])
    step = np.array([*found.offset_px, -found.growth])
    left = edges.across_px - found.design @ (sign * step)
    rms_px = float(np.sqrt(np.mean(edges.shift_px**2)))
    independent = len(left) / shared_along(left, found.angle_deg)
    shape_px = coherent_px(left, found.angle_deg)
    x, y = ((edges.segments.xy_px - centre_px) / np.mean(away)).T
    shown = [u * edges.segments.normal[:, 0] + v * edges.segments.normal[:, 1] for u, v in terms(x, y)[UNSEEN:]]
    left_by = np.stack(shown, axis=1)
    left_by = left_by - found.design @ np.linalg.lstsq(found.design, left_by, rcond=None)[0]
    per_term = float(np.sqrt(np.mean(np.sum(left_by**2, axis=1))))
    largest_px = most_coherent_px(left, found.angle_deg) / max(per_term, 1e-12)
    covariance = found.covariance * np.outer(sign, sign)
    return LimbObservation(step, covariance, rms_px, shape_px, independent, largest_px)


def design_of(edges: LimbEdges, centre_px: Array) -> Array:
    """Shift (n, 3) of the limb outward, px, per unit of centre and logarithm of the range."""
    normal = edges.segments.normal
    rho = np.einsum("ij,ij->i", edges.segments.xy_px - centre_px, normal)
    return np.column_stack([normal, -rho])
