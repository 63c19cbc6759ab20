"""How like each other image and simulation are: one figure that an empty, inverted or sloping frame cannot reach."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.brightness import correlation, fit_brightness
from tasks.compare.match import Match, framed_window, match_scene
from tasks.compare.occulted import Occulted
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

# So much sky around the disk that a brightness that goes on beyond the limb counts against the simulation.
RIM_RADII = 0.3
RIM_PX = 8.0
DIAMETER_PX = 200.0
# A disk this many sub-pixels across is as like its image as a finer one (measured: to 0.001).
ACROSS = 200.0
# A target in front of a body shines with at least this share of that body's light (dark moons and bright planets:
# Amalthea has 0.18 of Jupiter's albedo; where a planet's edge was taken for a moon it had 0.03 to 0.09).
LEAST_LIGHT = 0.1


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
    bright body see `likeness_in_front`.
    """
    if match.behind is not None:
        return likeness_in_front(match, match.behind)
    return with_sign(match, fit_brightness(match, match.simulation.bases)[0])


def likeness_in_front(match: Match, behind: Occulted) -> float:
    """The same where a bright body is behind the target, which may be the darker one. All light behind the disk is
    hidden, up to what the frame's dark level leaves open: as a free share it would explain any gentle shading of the
    body behind. A target with nearly no light of its own counts negative: a dark corner of the sky beside a planet
    would be one."""
    simulation, own = match.simulation, match.simulation.of_target
    hidden = simulation.bases[len(own) :].sum(axis=0)
    cover = simulation.coverage
    seen = replace(match, image=match.image - hidden)
    _, coefficients = fit_brightness(seen, np.concatenate([own, -cover[None]]))
    # What may be hidden besides: from nothing to all of the dark level.
    hidden = hidden - np.float32(np.clip(coefficients[len(own)], 0, max(behind.dark, 0.0))) * cover
    model, coefficients = fit_brightness(replace(match, image=match.image - hidden), own)
    alike = correlation(match.image, model + hidden, match.usable)
    lit, disk = (simulation.lit > 0.5) & match.usable, (cover > 0.99) & match.usable
    if not lit.any() or not disk.any():
        return alike
    bright = float(np.median(np.tensordot(coefficients[: len(own)], own, 1)[lit]))
    return (1 if bright > LEAST_LIGHT * float(-np.median(hidden[disk])) else -1) * alike


def with_sign(match: Match, model: NDArray[np.float64]) -> float:
    """Correlation of the image with `model` (ny, nx), negative where the model's target is darker than its sky."""
    sky = match.simulation.coverage < 1e-3
    lit = match.simulation.lit > 0.5
    if not (sky & match.usable).any() or not (lit & match.usable).any():
        return correlation(match.image, model, match.usable)
    brighter = float(np.median(model[lit & match.usable])) > float(np.median(model[sky & match.usable]))
    return (1 if brighter else -1) * correlation(match.image, model, match.usable)
