"""One crop of the observed image beside its simulation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.occulted import Occulted, light_behind
from tasks.simulate import Scene, Simulation
from tasks.simulate.window import Window

# Maps and photometric laws are good to some per cent of the signal; noise alone would trust bright pixels too much.
MODEL_ERROR = 0.05


@dataclass(frozen=True)
class Match:
    """An image crop and the simulation of `pose`, all under the same window (ny, nx). weight: inverse variance of the
    difference, 0 where the image cannot be used. measured: the pixels whose value is known, None: those that have a
    weight. behind: what the target hides of a body behind it, None where its surroundings are dark.

    Where a body is behind the target, the image is without its light, which the simulation's last basis takes away
    once more where the target hides it; pixels that the light is known from have no weight (`occulted.light_behind`).
    """

    image: NDArray[np.float32]
    weight: NDArray[np.float32]
    simulation: Simulation
    pose: Pose
    scene: Scene
    measured: NDArray[np.bool_] | None = None
    behind: Occulted | None = None

    @property
    def known(self) -> NDArray[np.bool_]:
        """Pixels whose value is known, also where it says nothing of the target."""
        return self.usable if self.measured is None else self.measured

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Pixels that may be compared."""
        return self.weight > 0

    @property
    def origin(self) -> tuple[int, int]:
        """Frame pixel (x, y) of the crop's first pixel."""
        return self.simulation.window.x0, self.simulation.window.y0

    @property
    def centre_px(self) -> NDArray[np.float64]:
        """Pixel (2,) of the target's centre in the crop."""
        return self.scene.camera.project(self.pose.target_in_camera_km) - self.origin


def match_scene(observation: Observation, scene: Scene, pose: Pose, window: Window | None = None) -> Match:
    """Simulate `pose`, cut the observation to the simulation's window (default: the target's, within a rim of the
    frame), and weigh its pixels by noise and model error."""
    simulation = scene.render(pose, window or framed_window(scene, pose))
    window = simulation.window
    image = window.crop(observation.image)
    usable = window.crop(observation.usable, fill=False)
    noise = window.crop(observation.noise, fill=1)
    bright = np.percentile(image[usable], 95) if usable.any() else 1.0
    variance = noise.astype(np.float64) ** 2 + (MODEL_ERROR * max(float(bright), 0.0)) ** 2
    weight = np.where(usable, 1.0 / np.maximum(variance, 1e-12), 0).astype(np.float32)
    behind = light_behind(observation, pose, scene, window)
    if behind is None:
        return Match(image, weight, simulation, pose, scene)
    weight = (weight * behind.near / (1 + weight * behind.sigma**2)).astype(np.float32)
    usable = usable & behind.clear
    return Match(image - behind.light, weight, simulation.hiding(behind.light), pose, scene, usable, behind)


def framed_window(scene: Scene, pose: Pose, margin_px: float | None = None) -> Window:
    """The target's window without what lies far outside the frame; when nothing of it is in the frame, whole, or as
    much of it as the frame would hold, the nearest part."""
    nx, ny = scene.camera.size_px
    whole = scene.window(pose, margin_px)
    rim = 8
    clipped = whole.moved(rim, rim).clipped((nx + 2 * rim, ny + 2 * rim)).moved(-rim, -rim)
    return clipped if min(clipped.shape) > 2 * rim else whole.nearest((nx + 2 * rim, ny + 2 * rim), (-rim, -rim))
