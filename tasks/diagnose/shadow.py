"""A part of the disk that is as dark as the sky where it should be sunlit: a shadow, or something in front of it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import uniform_map
from catalog.errors import FailedError
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from tasks.compare.match import framed_window, match_scene
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.diagnose.candidates import Candidate
from tasks.diagnose.settings import DiagnoseSettings
from tasks.diagnose.trying import ACROSS, COMPARED_PX, SETTLING, Explanation, Tried, at_rest, settled
from tasks.point.coarse import CoarseFind
from tasks.simulate import Scene
from tasks.simulate.window import Window, disk_radius_px

ITERATIONS = 5
# A lit arc trades size for place: the disk stays nearly as large as predicted.
SETTLING_SHADOWED = SETTLING.model_copy(update={"limit": 0.03})
# Darker than this share of what the simulation has there; where the simulation has at least this share of its most.
DARK_SHARE, BRIGHT_SHARE = 0.15, 0.25
# Of the disk's sunlit part: less is a crater, more leaves nothing to go by.
LEAST, MOST = 0.04, 0.7
# Half-shade and blur beyond the dark part's edge, pixels of the reduced picture.
RIM_PX = 4


def also_shadowed(
    all_tried: Tried, observation: Observation, predicted: Pose, scene: Scene, settings: DiagnoseSettings
) -> Tried:
    """What was tried, and the predicted pose with a dark part of its disk masked, if it has one."""
    first = next((e for e in all_tried.found if e.candidate.name == "as-predicted"), None)
    plain = replace(scene, basemap=uniform_map())
    cells = reduction_for(predicted, scene, COMPARED_PX)
    found = first and with_shadow_masked(observation, first, plain, predicted, settings, cells)
    return (
        replace(all_tried, found=[*all_tried.found, found], hypotheses=all_tried.hypotheses + 1) if found else all_tried
    )


def with_shadow_masked(
    observation: Observation, first: Explanation, scene: Scene, predicted: Pose, settings: DiagnoseSettings, cells: int
) -> Explanation | None:
    """The predicted pose with the dark part of the disk masked, settled; None where no such part is found.

    The part depends on where the disk is, and the disk on what is masked: both in turn, from the place that the search
    found. scene: without markings.
    """
    n = reduction_for(first.pose, scene, settings.settle_px)
    seen, small = reduced_observation(observation, n), reduced_scene(scene, n)
    # Not as large as the dark part may have made it.
    pose, dark = first.pose.with_range_factor(first.size), None
    for _ in range(ITERATIONS):
        dark = dark_part(seen, pose, small.coarser(pose, ACROSS))
        if dark is None:
            return None
        pose, _ = at_rest(masked(seen, dark), pose, small.coarser(pose, ACROSS), SETTLING_SHADOWED)
    if dark is None:
        return None
    whole = np.kron(dark, np.ones((n, n), bool))
    ny, nx = observation.quality.shape
    whole = np.pad(whole, ((0, max(ny - whole.shape[0], 0)), (0, max(nx - whole.shape[1], 0))))[:ny, :nx]
    candidate = Candidate("shadowed", float(np.mean(whole)), masked(observation, whole), pose)
    return settled(candidate, CoarseFind(pose, first.score, 1), predicted, scene, scene, settings, cells)


def masked(observation: Observation, pixels: NDArray[np.bool_]) -> Observation:
    """The observation with pixels (ny, nx) masked."""
    flag = np.where(pixels, np.uint16(Quality.MASKED_BY_USER), np.uint16(0))
    return replace(observation, quality=(observation.quality | flag).astype(np.uint16))


def dark_part(observation: Observation, pose: Pose, scene: Scene) -> NDArray[np.bool_] | None:
    """Pixels (ny, nx) of the sunlit disk that are dark, with a rim; None where they are too few or too many."""
    import cv2

    radius = disk_radius_px(pose, scene.camera, scene.target)
    try:
        match = match_scene(observation, scene, pose, framed_window(scene, pose, RIM_PX + 0.2 * radius))
    except FailedError:
        return None
    simulated = match.simulation.image().astype(np.float64)
    sky = match.usable & (match.simulation.coverage < 1e-3)
    bright = match.usable & (simulated > BRIGHT_SHARE * simulated.max())
    if not sky.any() or not bright.any():
        return None
    above = match.image - float(np.median(match.image[sky]))
    scale = float(np.percentile(above[bright] / simulated[bright], 75))
    dark = bright & (above < DARK_SHARE * scale * simulated)
    dark = cv2.morphologyEx(dark.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
    if not LEAST <= np.count_nonzero(dark) / np.count_nonzero(bright) <= MOST:
        return None
    side = 2 * RIM_PX + 1
    grown = cv2.dilate(dark.astype(np.uint8), np.ones((side, side), np.uint8)) > 0
    return in_frame(grown, match.simulation.window, observation.quality.shape)


def in_frame(pixels: NDArray[np.bool_], window: Window, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Pixels of a window, in a frame of (ny, nx)."""
    frame = np.zeros(shape, bool)
    inside = window.clipped((shape[1], shape[0]))
    part = np.s_[inside.y0 - window.y0 : inside.y1 - window.y0, inside.x0 - window.x0 : inside.x1 - window.x0]
    frame[inside.y0 : inside.y1, inside.x0 : inside.x1] = pixels[part]
    return frame
