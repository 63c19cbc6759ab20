"""Find the target anywhere in the frame: masked normalised cross-correlation at reduced resolution."""

from dataclasses import dataclass, replace

import numpy as np

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.point.rotation import pose_pointed_at
from tasks.simulate import Scene
from tasks.simulate.window import Window, disk_radius_px

TEMPLATE_DIAMETER_PX = 64
SPECK_PX = 5
ALLOWANCE = 1.25


@dataclass(frozen=True)
class CoarseFind:
    """pose: pointed so that the target falls where it was found. score: correlation there, -1..1. step_px: resolution
    of the search. next_best: pointed so that it falls where it fits best at least its own diameter away; None where
    there is no such place."""

    pose: Pose
    score: float
    step_px: int
    next_best: Pose | None = None


def find_target(
    observation: Observation,
    pose: Pose,
    scene: Scene,
    min_overlap: float,
    step_px: int | None = None,
    clip_at: float | None = None,
) -> CoarseFind:
    """Place of the target in the frame, to about a cell of the search grid, wherever the metadata put it.

    The simulated disk with a rim of sky is correlated with every position of the frame at which at least `min_overlap`
    of it lies on usable pixels (Padfield 2012, IEEE Trans. Image Process. 21, 2706), so that a disk cut by the frame
    is found as well. step_px: cell of the search grid, by default one of TEMPLATE_DIAMETER_PX across the disk.
    clip_at: share of the highest brightness at which image and simulation are clipped, so that what is sunlit counts,
    not how bright clouds and markings make it; None does not.
    """
    from skimage.registration._masked_phase_cross_correlation import cross_correlate_masked

    n = step_px or reduction_for(pose, scene, TEMPLATE_DIAMETER_PX)
    observation = without_specks(observation, lit_width_px(pose, scene), clip_at or ALLOWANCE)
    observation, scene = reduced_observation(observation, n), reduced_scene(scene, n)
    frame_centre = (np.array(scene.camera.size_px) - 1) / 2
    centred = pose_pointed_at(pose, scene.camera, frame_centre)
    window = centred_window(centred, scene)
    template = scene.render(centred, window).image().astype(np.float64)
    template = np.minimum(template, (clip_at or 1.0) * template.max())
    usable = observation.usable
    image = np.where(usable, observation.image, 0).astype(np.float64)
    correlation = cross_correlate_masked(
        image,
        template,
        usable,
        np.ones(template.shape, bool),
        mode="full",
        axes=(0, 1),
        overlap_ratio=min_overlap,
    )

    def pointed(row: int, column: int) -> Pose:
        # In "full" mode, index 0 puts the template's last cell on the image's first.
        top_left = np.array([column - template.shape[1] + 1, row - template.shape[0] + 1])
        return pose_pointed_at(pose, scene.camera, frame_centre + top_left - np.array([window.x0, window.y0]))

    row, column = (int(each) for each in np.unravel_index(int(np.argmax(correlation)), correlation.shape))
    rows, columns = np.indices(correlation.shape)
    apart = np.hypot(rows - row, columns - column) > 2 * disk_radius_px(centred, scene.camera, scene.target)
    next_best = None
    if apart.any():
        other = int(np.argmax(np.where(apart, correlation, -np.inf)))
        next_best = pointed(*(int(each) for each in np.unravel_index(other, correlation.shape)))
    return CoarseFind(pointed(row, column), float(correlation[row, column]), n, next_best)


def centred_window(pose: Pose, scene: Scene) -> Window:
    """The target's window with the rim of sky that is looked for with it."""
    radius = disk_radius_px(pose, scene.camera, scene.target)
    return scene.window(pose, margin_px=max(4.0, 0.25 * radius))


def lit_width_px(pose: Pose, scene: Scene) -> float:
    """Width of the sunlit part of the disk, pixels."""
    return disk_radius_px(pose, scene.camera, scene.target) * (1 + float(np.cos(np.radians(pose.phase_deg))))


def without_specks(observation: Observation, width_px: float, allowance: float = ALLOWANCE) -> Observation:
    """The observation with what is brighter than everything of a target's size pulled down: hot pixels, cosmic rays,
    bright columns, stars. width_px: of the target's sunlit part.

    The limit is the highest value that all pixels of some square of up to SPECK_PX reach (a grey-scale opening), half
    the sunlit width at most, times an allowance for noise.
    """
    import cv2

    usable = observation.usable
    if not usable.any():
        return observation
    side = int(np.clip(width_px / 2, 2, SPECK_PX))
    low = np.float32(np.percentile(observation.image[usable], 1))
    image = np.where(usable, observation.image, low)
    span = max(float(cv2.erode(image, np.ones((side, side), np.uint8)).max()) - float(low), 0.0)
    return replace(observation, image=np.minimum(image, float(low) + allowance * span).astype(np.float32))
