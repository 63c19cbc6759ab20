"""Find the target by all bodies that the pose knows in the frame: their places relative to each other are known well,
so the picture of all of them is looked for as one."""

import numpy as np
from numpy.typing import NDArray

from catalog.observation import UNUSABLE, Observation, Quality
from catalog.pose import Pose
from tasks.bodies.masks import alone, disk_of
from tasks.bodies.placed import bodies_of, in_frame
from tasks.bodies.seen import seen_by_frame
from tasks.compare.reduce import reduced_observation, reduced_scene
from tasks.point.coarse import CoarseFind, find_target, without_specks
from tasks.point.rotation import pose_moved_by
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float64]

# The picture is made with so many cells to the target's radius, or so many to the frame's side where that is coarser.
CELLS_PER_RADIUS, CELLS_PER_SIDE = 8.0, 256
# It reaches beyond the frame by so much of the frame's side: pointing errors may be as large.
BEYOND = 0.5
# What shift is compared: on so much of the frame, at least.
LEAST_OVERLAP = 0.5
# The target is then looked for where nothing but it is left, with what the first search may be off, cells.
OFF_CELLS = 3.0
# Brightness of rings before the sky.
RING_ALBEDO = 0.3


def find_with_others(observation: Observation, pose: Pose, scene: Scene, min_overlap: float) -> CoarseFind | None:
    """Place of the target, to about a cell; None where the pose knows no other body in or near the frame."""
    if not any(
        body.place and in_frame(body, scene.camera, BEYOND * max(scene.camera.size_px))
        for body in bodies_of(pose, scene.target)
    ):
        return None
    from skimage.registration._masked_phase_cross_correlation import cross_correlate_masked

    nx, ny = scene.camera.size_px
    radius = disk_radius_px(pose, scene.camera, scene.target)
    n = max(1, int(min(radius / CELLS_PER_RADIUS, max(nx, ny) / CELLS_PER_SIDE)))
    small, coarse = reduced_observation(without_saturation(observation), n), reduced_scene(scene, n)
    image = np.where(small.usable, small.image, 0).astype(np.float64)
    picture, margin = picture_of_all(pose, coarse)
    scores = cross_correlate_masked(
        compressed(image, small.usable),
        picture,
        small.usable,
        np.ones(picture.shape, bool),
        mode="full",
        axes=(0, 1),
        overlap_ratio=LEAST_OVERLAP,
    )
    row, column = (int(each) for each in np.unravel_index(int(np.argmax(scores)), scores.shape))
    # In "full" mode, index 0 puts the template's last cell on the image's first.
    moved = np.array([column - picture.shape[1] + 1 + margin[0], row - picture.shape[0] + 1 + margin[1]])
    found = CoarseFind(pose_moved_by(pose, scene.camera, n * moved), float(scores[row, column]), n)
    return refined(observation, found, scene, min_overlap)


def refined(observation: Observation, found: CoarseFind, scene: Scene, min_overlap: float) -> CoarseFind:
    """The find, with the target looked for where all else is masked; not where it stands before another body."""
    if is_before_another(found.pose, scene):
        return found
    left = alone(observation, found.pose, scene, OFF_CELLS * found.step_px)
    if not left.usable.any():
        return found
    again = find_target(left, found.pose, scene, min_overlap)
    before, after = (scene.camera.project(p.target_in_camera_km) for p in (found.pose, again.pose))
    near = np.hypot(*(after - before)) <= OFF_CELLS * (found.step_px + again.step_px)
    return CoarseFind(again.pose, max(again.score, found.score), again.step_px) if near else found


def is_before_another(pose: Pose, scene: Scene) -> bool:
    """Whether the target's disk lies before another body's, wholly or in part."""
    bodies = bodies_of(pose, scene.target)
    own = next(body for body in bodies if body.place is None)
    disk = disk_of(own, scene.camera)
    farther = [body for body in bodies if body is not own and body.pose.range_km > own.pose.range_km]
    return any(in_frame(body, scene.camera) and (disk_of(body, scene.camera) & disk).any() for body in farther)


def without_saturation(observation: Observation) -> Observation:
    """The observation with saturated pixels as bright ones: a planet beside its moon may be white."""
    only = (observation.quality & np.uint16(UNUSABLE)) == np.uint16(Quality.SATURATED)
    quality = np.where(only, np.uint16(0), observation.quality).astype(np.uint16)
    return without_specks(Observation(observation.image, observation.noise, quality), 10.0)


def compressed(image: Array, usable: NDArray[np.bool_]) -> Array:
    """Square root of the brightness above the sky's (ny, nx): bodies count, not which of them is the brighter."""
    low, high = np.percentile(image[usable], [1, 99.5]) if usable.any() else (0.0, 1.0)
    return np.where(usable, np.sqrt(np.clip((image - low) / max(high - low, 1e-12), 0, 1)), 0.0)


def picture_of_all(pose: Pose, scene: Scene) -> tuple[Array, tuple[int, int]]:
    """Square root of the brightness of all bodies, the brightest 1, and by how many cells (x, y) it reaches beyond the
    frame. Bodies are uniform, lunar-Lambert, as bright as their geometric albedos."""
    nx, ny = scene.camera.size_px
    margin = (round(BEYOND * nx), round(BEYOND * ny))
    camera = scene.camera.model_copy(
        update={
            "size_px": (nx + 2 * margin[0], ny + 2 * margin[1]),
            "centre_px": (scene.camera.centre_px[0] + margin[0], scene.camera.centre_px[1] + margin[1]),
        }
    )
    seen = seen_by_frame(pose, camera, scene.target)
    mu0, mu = (np.cos(np.radians(np.nan_to_num(seen.planes[name], nan=90.0))) for name in ("incidence", "emission"))
    light = np.where(mu0 > 0, mu0 / 2 + mu0 / np.maximum(mu0 + mu, 1e-6), 0.0) * (1 - np.nan_to_num(seen.shadow))
    for body in bodies_of(pose, scene.target):
        albedo = scene.target.geometric_albedo if body.place is None else body.place.geometric_albedo
        light[seen.body_id == body.naif_id] *= albedo
    light = light * np.exp(-seen.ring_depth) + RING_ALBEDO * (1 - np.exp(-seen.ring_depth))
    return np.sqrt(light / max(float(light.max()), 1e-12)), margin
