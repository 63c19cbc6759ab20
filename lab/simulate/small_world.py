"""A small made-up world with known truth: one camera, Europa, and images rendered from a true pose by a renderer that
shares no code with the estimator's (`lab.simulate.independent`).

The paper's table 1 is repeated in it, and the tests with planted truth live in it. Needs no files but the packaged map.
"""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.basemap import BaseMap, map_of_target
from catalog.camera import Camera
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from lab.simulate.independent import independent_image
from tasks.simulate import Scene, SceneSettings

EUROPA = find_target("europa")
RANGE_KM = 1.0e6
BODY_FROM_J2000 = rotation_from_vector_deg([20, 30, 40])
CAMERA_FROM_J2000 = rotation_from_vector_deg([-15, 65, 25])
PEAK_DN, SKY_DN, NOISE_DN = 200.0, 6.0, 1.0
# What the scene's names of laws are to the ray caster; a mixture has no law of its own.
LAWS = {"mixture": "lunar-lambert"}


def small_camera(diameter_px: float = 160.0, size_px: tuple[int, int] = (224, 208)) -> Camera:
    """Camera through which Europa at RANGE_KM is `diameter_px` wide."""
    focal_px = diameter_px / 2 * RANGE_KM / EUROPA.mean_radius_km
    return Camera(
        name="small",
        size_px=size_px,
        centre_px=(109.3, 105.6),
        focal_length_px=focal_px,
        focal_length_sigma=0.0,
        psf_sigma_px=0.8,
    )


def true_pose(
    camera: Camera,
    centre_px: ArrayLike | None = None,
    range_km: float = RANGE_KM,
    phase_deg: float = 50.0,
    sun_azimuth_deg: float = 200.0,
) -> Pose:
    """Target centre at `centre_px` (default: middle of the frame); the Sun `phase_deg` from the spacecraft, on the
    side `sun_azimuth_deg`, from +x towards +y of the image."""
    middle = (np.array(camera.size_px) - 1) / 2 + (0.37, -0.22)
    sight = camera.ray(middle if centre_px is None else centre_px)
    azimuth, phase = np.radians([sun_azimuth_deg, phase_deg])
    side = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    side -= (side @ sight) * sight
    sun = -np.cos(phase) * sight + np.sin(phase) * side / np.linalg.norm(side)
    return Pose(
        et=0.0,
        camera_from_j2000=CAMERA_FROM_J2000,
        target_from_spacecraft_km=CAMERA_FROM_J2000.T @ sight * range_km,
        sun_from_target_km=CAMERA_FROM_J2000.T @ sun * 7.8e8,
        body_from_j2000=BODY_FROM_J2000,
    )


@cache
def europa_map() -> BaseMap:
    """The catalog's map."""
    return map_of_target(EUROPA)


def scene_of(
    camera: Camera, photometry: str = "lunar-lambert", basemap: BaseMap | None = None, **settings: Any
) -> Scene:
    """Scene of Europa with the settings that the corrections use."""
    chosen = SceneSettings.model_validate({"photometry": photometry, **settings})
    return Scene(camera, EUROPA, basemap or europa_map(), chosen)


def clean_image(scene: Scene, pose: Pose) -> NDArray[np.float32]:
    """Noise-free frame (ny, nx), DN, of what the camera of `scene` sees at `pose`, by the law of its settings and
    another renderer than the scene's."""
    law = scene.settings.photometry
    return image_by_laws(scene, pose, {LAWS.get(law, law): 1.0})


def image_by_laws(scene: Scene, pose: Pose, laws: dict[str, float]) -> NDArray[np.float32]:
    """The same by a sum of laws of `lab.honesty.laws`, each with a weight."""
    bright = independent_image(scene.camera, scene.target, pose, laws, scene.basemap, scene.psf_sigma_px)
    return (SKY_DN + PEAK_DN * bright).astype(np.float32)


def observed(image: NDArray, noise_dn: float = NOISE_DN, seed: int = 1) -> Observation:
    """`image` (ny, nx) with white noise added."""
    noisy = image + noise_dn * np.random.default_rng(seed).standard_normal(image.shape)
    return Observation(
        noisy.astype(np.float32), np.full(image.shape, noise_dn, np.float32), np.zeros(image.shape, np.uint16)
    )


def observation_of(scene: Scene, pose: Pose, noise_dn: float = NOISE_DN, seed: int = 1) -> Observation:
    """What the camera of `scene` saw at the true `pose`."""
    return observed(clean_image(scene, pose), noise_dn, seed)


def flagged(observation: Observation, where: NDArray[np.bool_], value: float = np.nan) -> Observation:
    """Copy with the pixels `where` (ny, nx) set to `value` and flagged MISSING."""
    image = np.where(where, np.float32(value), observation.image)
    quality = np.where(where, np.uint16(Quality.MISSING), observation.quality)
    return Observation(image, observation.noise, quality.astype(np.uint16))
