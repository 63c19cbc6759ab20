"""The same scene and image at a fraction of the resolution; a pose means the same to both."""

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px


def reduction_for(pose: Pose, scene: Scene, diameter_px: float) -> int:
    """Bin size that brings the disk's diameter to about `diameter_px`, 1 for small disks."""
    return max(1, round(2 * disk_radius_px(pose, scene.camera, scene.target) / diameter_px))


def reduced_camera(camera: Camera, n: int) -> Camera:
    """Camera whose pixels are n x n of the undistorted frame's."""
    nx, ny = (size // n for size in camera.size_px)
    centre = tuple((c - (n - 1) / 2) / n for c in camera.centre_px)
    # The binned pixel's own box is part of the detector model; the optics' blur shrinks with the pixels.
    changes = {
        "size_px": (nx, ny),
        "centre_px": centre,
        "focal_length_px": camera.focal_length_px / n,
        "psf_sigma_px": camera.psf_sigma_px / n,
    }
    return camera.model_copy(update=changes)


def reduced_scene(scene: Scene, n: int) -> Scene:
    """Scene with a camera of n x n binned pixels."""
    if n == 1:
        return scene
    psf, (x, y) = scene.settings.psf_sigma_px, scene.settings.trail_px
    changes = {"psf_sigma_px": None if psf is None else psf / n, "trail_px": (x / n, y / n)}
    settings = scene.settings.model_copy(update=changes)
    return Scene(reduced_camera(scene.camera, n), scene.target, scene.basemap, settings)


def reduced_observation(observation: Observation, n: int) -> Observation:
    """n x n means over usable pixels; a cell with less than half of its pixels usable is MISSING."""
    if n == 1:
        return observation
    usable = observation.usable.astype(np.float64)
    count = _cells(usable, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        image = _cells(np.where(observation.usable, observation.image, 0.0), n) / count
        noise = np.sqrt(_cells(np.where(observation.usable, observation.noise, 0.0) ** 2, n) / count)
    good = count >= 0.5
    kept_image, kept_noise = (np.where(good, a, 0).astype(np.float32) for a in (image, noise / n))
    return Observation(kept_image, kept_noise, np.where(good, 0, int(Quality.MISSING)).astype(np.uint16))


def _cells(a: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """Means of n x n cells; OpenCV's area resampling by a whole factor is that, in a tenth of numpy's time."""
    ny, nx = a.shape[0] // n, a.shape[1] // n
    import cv2

    return cv2.resize(a[: ny * n, : nx * n], (nx, ny), interpolation=cv2.INTER_AREA)
