"""How like each other image and simulation are: one figure that an empty, inverted or sloping frame cannot reach."""

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.brightness import correlation, fit_brightness
from tasks.compare.match import Match, framed_window, match_scene
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

# So much sky around the disk that a brightness that goes on beyond the limb counts against the simulation.
RIM_RADII = 0.3
RIM_PX = 8.0
DIAMETER_PX = 200.0
# A disk this many sub-pixels across is as like its image as a finer one (measured: to 0.001).
ACROSS = 200.0


def with_rim(observation: Observation, pose: Pose, scene: Scene) -> Match:
    """Image and simulation of `pose` with a rim of sky wide enough for `likeness`, large disks at less resolution."""
    n = reduction_for(pose, scene, DIAMETER_PX)
    observation, scene = reduced_observation(observation, n), reduced_scene(scene, n)
    radius = disk_radius_px(pose, scene.camera, scene.target)
    window = framed_window(scene, pose, RIM_PX + RIM_RADII * radius)
    return match_scene(observation, scene.coarser(pose, ACROSS), pose, window)


def likeness(match: Match) -> float:
    """Correlation (-1..1) of the image with its fitted simulation, over usable pixels of disk and rim.

    A least-squares fit is proud of a target that is darker than the sky, too: that counts negative. In front of a
    bright body the target may be the darker one, but its own light is none that is taken away.
    """
    model, coefficients = fit_brightness(match, match.simulation.bases)
    own = match.simulation.of_target
    if match.simulation.hides:
        lit = (match.simulation.lit > 0.5) & match.usable
        bright = np.tensordot(coefficients[: len(own)], own, 1)
        is_light = bool(lit.any()) and float(np.median(bright[lit])) > 0
        return (1 if is_light else -1) * correlation(match.image, model, match.usable)
    return with_sign(match, model)


def with_sign(match: Match, model: NDArray[np.float64]) -> float:
    """Correlation of the image with `model` (ny, nx), negative where the model's target is darker than its sky."""
    sky = match.simulation.coverage < 1e-3
    lit = match.simulation.lit > 0.5
    if not (sky & match.usable).any() or not (lit & match.usable).any():
        return correlation(match.image, model, match.usable)
    brighter = float(np.median(model[lit & match.usable])) > float(np.median(model[sky & match.usable]))
    return (1 if brighter else -1) * correlation(match.image, model, match.usable)
