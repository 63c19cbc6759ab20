"""The image and its scene at a fraction of the resolution, and how large a pixel of the map is there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.closeup.patches import Surfaces, correlated
from tasks.closeup.texture import Texture, image_texture, map_texture
from tasks.compare.reduce import reduced_observation, reduced_scene
from tasks.project.points import body_points
from tasks.simulate import Scene
from tasks.simulate.window import Window

Array = NDArray[np.float64]
SAMPLES = 9


@dataclass(frozen=True)
class Level:
    """n: so many pixels of the frame, along each side, are one here. scene: with the camera of these pixels.
    observation, texture: of the image there."""

    n: int
    scene: Scene
    observation: Observation
    texture: Texture

    @classmethod
    def of(cls, observation: Observation, scene: Scene, n: int) -> "Level":
        """Of an image at n x n pixels."""
        seen = reduced_observation(observation, n)
        return cls(n, reduced_scene(scene, n), seen, image_texture(seen))

    def surfaces(self, pose: Pose, reach_px: int, across: int) -> Surfaces:
        """Correlations of the image's patches with the map as `pose` shows it, to reach_px around."""
        ny, nx = self.texture.values.shape
        window = Window(-reach_px, -reach_px, nx + reach_px, ny + reach_px)
        return correlated(self.texture, map_texture(self.scene, pose, window), reach_px, across)


def on_body(pose: Pose, scene: Scene) -> Array:
    """Those of `samples` (n, 2) that see the body, the middle one first."""
    xy = samples(scene)
    seen = xy[np.isfinite(body_points(pose, scene.camera, scene.target, xy)[:, 0])]
    if len(seen) == 0:
        return seen
    middle = np.argmin(np.linalg.norm(seen - seen.mean(axis=0), axis=1))
    return np.concatenate([seen[middle : middle + 1], np.delete(seen, middle, axis=0)])


def samples(scene: Scene) -> Array:
    """Pixels (n, 2), evenly over the frame."""
    nx, ny = scene.camera.size_px
    x, y = np.meshgrid(np.linspace(0, nx - 1, SAMPLES), np.linspace(0, ny - 1, SAMPLES))
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def map_pixel_km(scene: Scene) -> float:
    """Side of a pixel of the base map, along a meridian."""
    return float(np.pi * scene.target.mean_radius_km / scene.basemap.albedo.shape[0])


def pixel_km(pose: Pose, scene: Scene) -> float:
    """Kilometres across the line of sight per pixel, median over what of the frame sees the body; NaN where nothing
    does."""
    points = body_points(pose, scene.camera, scene.target, samples(scene))
    away = np.linalg.norm(points - pose.spacecraft_in_body_km, axis=-1)
    away = away[np.isfinite(away)]
    return float(np.median(away) / scene.camera.focal_length_px) if away.size else float("nan")
