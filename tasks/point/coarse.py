"""Find the target anywhere in the frame: masked normalised cross-correlation at reduced resolution."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.reduce import reduced_observation, reduced_scene, reduction_for
from tasks.point.rotation import pose_pointed_at
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

TEMPLATE_DIAMETER_PX = 64


@dataclass(frozen=True)
class CoarseFind:
    """pose: pointed so that the target falls where it was found. score: correlation there, -1..1. step_px: resolution
    of the search."""

    pose: Pose
    score: float
    step_px: int


def find_target(observation: Observation, pose: Pose, scene: Scene, min_overlap: float) -> CoarseFind:
    """Place of the target in the frame, to about a cell of the search grid, wherever the metadata put it.

    The simulated disk with a rim of sky is correlated with every position of the frame at which at least `min_overlap`
    of it lies on usable pixels (Padfield 2012, IEEE Trans. Image Process. 21, 2706), so that a disk cut by the frame
    is found as well.
    """
    from skimage.registration._masked_phase_cross_correlation import cross_correlate_masked

    n = reduction_for(pose, scene, TEMPLATE_DIAMETER_PX)
    observation, scene = reduced_observation(observation, n), reduced_scene(scene, n)
    frame_centre = (np.array(scene.camera.size_px) - 1) / 2
    centred = pose_pointed_at(pose, scene.camera, frame_centre)
    radius = disk_radius_px(centred, scene.camera, scene.target)
    window = scene.window(centred, margin_px=max(4.0, 0.25 * radius))
    template = scene.render(centred, window).image().astype(np.float64)
    usable = observation.usable
    image = clipped_outliers(observation.image, usable).astype(np.float64)
    correlation = cross_correlate_masked(
        image,
        template,
        usable,
        np.ones(template.shape, bool),
        mode="full",
        axes=(0, 1),
        overlap_ratio=min_overlap,
    )
    row, column = np.unravel_index(int(np.argmax(correlation)), correlation.shape)
    # In "full" mode, index 0 puts the template's last cell on the image's first.
    top_left = np.array([column - template.shape[1] + 1, row - template.shape[0] + 1])
    found = frame_centre + top_left - np.array([window.x0, window.y0])
    return CoarseFind(pose_pointed_at(pose, scene.camera, found), float(correlation[row, column]), n)


def clipped_outliers(image: NDArray[np.float32], usable: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Copy with unusable pixels 0 and the brightest 0.02 % (cosmic rays) pulled down."""
    if not usable.any():
        return np.zeros_like(image)
    high = np.percentile(image[usable], 99.98)
    return np.where(usable, np.minimum(image, high), 0).astype(np.float32)
