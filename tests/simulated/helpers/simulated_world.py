"""The small world of `lab.simulate.small_world`, with pictures by another renderer than the estimator's: the ray caster
of the honesty benchmark (plain numpy; own intersection, shading, map lookup and optics; it imports nothing of `tasks`).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from catalog.observation import Observation, Quality
from catalog.pose import Pose
from lab.honesty.caster import View, render
from lab.honesty.optics import Blur, blurred
from lab.honesty.solids import Solid
from lab.simulate.small_world import (
    BODY_FROM_J2000,
    CAMERA_FROM_J2000,
    EUROPA,
    NOISE_DN,
    PEAK_DN,
    RANGE_KM,
    SKY_DN,
    TRUTH_OVERSAMPLE,
    europa_map,
    observed,
    scene_of,
    small_camera,
    true_pose,
)
from tasks.simulate import Scene

__all__ = [
    "BODY_FROM_J2000",
    "CAMERA_FROM_J2000",
    "EUROPA",
    "NOISE_DN",
    "PEAK_DN",
    "RANGE_KM",
    "SKY_DN",
    "TRUTH_OVERSAMPLE",
    "clean_image",
    "europa_map",
    "flagged",
    "foreign_image",
    "observation_of",
    "observed",
    "scene_of",
    "small_camera",
    "true_pose",
]
# What the scene's names of laws are to the ray caster; a mixture has no law of its own.
LAWS = {"mixture": "lunar-lambert"}
MARGIN_PX = 12


def clean_image(scene: Scene, pose: Pose) -> NDArray[np.float32]:
    """Noise-free frame (ny, nx), DN, of what the camera of `scene` sees at `pose`, by the law of its settings."""
    law = scene.settings.photometry
    return foreign_image(scene, pose, {LAWS.get(law, law): 1.0})


def foreign_image(scene: Scene, pose: Pose, laws: dict[str, float]) -> NDArray[np.float32]:
    """The same by a sum of laws of `lab.honesty.laws`, each with a weight."""
    camera, target = scene.camera, scene.target
    x, y = (float(each) for each in camera.project(pose.target_in_camera_km))
    radius = camera.focal_length_px * max(target.radii_km) / pose.range_km
    reach = int(np.ceil(radius)) + MARGIN_PX
    x0, y0, side = round(x) - reach, round(y) - reach, 2 * reach + 1
    view = View(pose.camera_from_j2000, camera.focal_length_px, camera.centre_px, x0, y0, side, side, TRUTH_OVERSAMPLE)
    map_from_body = Rotation.from_euler("z", -scene.basemap.left_edge_deg, degrees=True).as_matrix()
    sun = pose.sun_from_target_km / np.linalg.norm(pose.sun_from_target_km)
    fine: NDArray[np.float32] = np.zeros((side * TRUTH_OVERSAMPLE,) * 2, np.float32)
    for law, weight in laws.items():
        solid = Solid(
            pose.target_from_spacecraft_km,
            np.asarray(target.radii_km),
            pose.body_from_j2000,
            law,
            texture=scene.basemap.albedo,
            map_from_body=np.asarray(map_from_body),
        )
        fine += np.float32(weight) * render(view, [solid], sun)
    bright = blurred(fine, Blur(scene.psf_sigma_px), TRUTH_OVERSAMPLE)
    frame = np.zeros((camera.size_px[1], camera.size_px[0]))
    top, left = max(y0, 0), max(x0, 0)
    bottom, right = min(y0 + side, frame.shape[0]), min(x0 + side, frame.shape[1])
    if bottom > top and right > left:
        frame[top:bottom, left:right] = bright[top - y0 : bottom - y0, left - x0 : right - x0]
    return (SKY_DN + PEAK_DN / np.percentile(bright, 99) * frame).astype(np.float32)


def observation_of(scene: Scene, pose: Pose, noise_dn: float = NOISE_DN, seed: int = 1) -> Observation:
    """What the camera of `scene` saw at the true `pose`."""
    return observed(clean_image(scene, pose), noise_dn, seed)


def flagged(observation: Observation, where: NDArray[np.bool_], value: float = np.nan) -> Observation:
    """Copy with the pixels `where` set to `value` and flagged MISSING."""
    image = np.where(where, np.float32(value), observation.image)
    quality = np.where(where, np.uint16(Quality.MISSING), observation.quality)
    return Observation(image, observation.noise, quality.astype(np.uint16))
