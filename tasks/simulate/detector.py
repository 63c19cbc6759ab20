"""From a simulated scene to the numbers a detector would have sent: raw geometry, brightness, noise, rounding."""

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from tasks.simulate.scene import Scene, Simulation
from tasks.simulate.window import Window
from tasks.undistort.mark_fit import spot
from tasks.undistort.model import DistortionModel

EDGE_STEPS = 200
MARK_REACH_PX = 6
MARK_DEPTH = 0.9
BRIGHT_PERCENTILE = 99.0


def raw_frame(scene: Scene, pose: Pose, model: DistortionModel, peak_dn: float, sky_dn: float) -> NDArray[np.float32]:
    """Noise-free image float32 (ny, nx) in the raw frame of `model`, DN: the bright parts of the disk near `peak_dn`
    above a sky of `sky_dn`."""
    simulation = scene.render(pose)
    brightness = simulation.image()
    brightness *= peak_dn / np.percentile(brightness[simulation.lit > 0.5], BRIGHT_PERCENTILE)
    columns, rows = model.raw_size_px
    image = np.full((rows, columns), sky_dn, np.float32)
    part = _raw_window(simulation.window, model).clipped(model.raw_size_px)
    image[part.y0 : part.y1, part.x0 : part.x1] += _resampled(brightness, simulation, model, part)
    return image


def _raw_window(window: Window, model: DistortionModel) -> Window:
    """Raw pixels that hold the undistorted `window`."""
    x = np.linspace(window.x0, window.x1 - 1, EDGE_STEPS)
    y = np.linspace(window.y0, window.y1 - 1, EDGE_STEPS)
    sides = [
        (x, np.full_like(x, y[0])),
        (x, np.full_like(x, y[-1])),
        (np.full_like(y, x[0]), y),
        (np.full_like(y, x[-1]), y),
    ]
    raw = model.distort_points(np.concatenate([np.stack(side, axis=-1) for side in sides]))
    low, high = np.floor(np.nanmin(raw, axis=0)).astype(int), np.ceil(np.nanmax(raw, axis=0)).astype(int) + 1
    return Window(int(low[0]), int(low[1]), int(high[0]), int(high[1]))


def _resampled(
    brightness: NDArray[np.float32], simulation: Simulation, model: DistortionModel, part: Window
) -> NDArray[np.float32]:
    from scipy.ndimage import map_coordinates  # OpenCV's bicubic rounds places to 1/32 px

    grid = np.stack(np.meshgrid(np.arange(part.x0, part.x1), np.arange(part.y0, part.y1)), axis=-1)
    places = model.undistort_points(grid.astype(np.float64)) - (simulation.window.x0, simulation.window.y0)
    values = map_coordinates(brightness, np.moveaxis(places[..., ::-1], -1, 0), order=3, mode="constant")
    return np.maximum(np.nan_to_num(values), 0)


def exposed(
    image: NDArray[np.float32], camera: Camera, rng: np.random.Generator, marks_xy: NDArray[np.float64] | None = None
) -> Observation:
    """What `camera` records of a noise-free raw `image` (ny, nx), DN: reseau marks at `marks_xy` (n, 2), not flagged
    (finding them is the undistortion's business), its noise model, saturation, whole numbers if its file has 8 bits."""
    signal = image if marks_xy is None else image * _let_through(image.shape, marks_xy)
    quality = np.zeros(image.shape, np.uint16)
    model = camera.noise
    noise = np.sqrt(model.read_dn**2 + signal / model.gain_e_per_dn + (model.relative * signal) ** 2)
    recorded = signal + noise * rng.standard_normal(image.shape, dtype=np.float32)
    if camera.saturation_dn is not None:
        quality[recorded >= camera.saturation_dn] |= np.uint16(Quality.SATURATED)
        recorded = np.minimum(recorded, camera.saturation_dn)
    if has_8_bits(camera):
        recorded = np.clip(np.rint(recorded), 0, 255)
    return Observation(recorded.astype(np.float32), noise.astype(np.float32), quality)


def _let_through(shape: tuple[int, ...], marks_xy: NDArray[np.float64]) -> NDArray[np.float32]:
    """Fraction of the light (ny, nx) that passes the marks, with the profile that real marks were measured to have."""
    lines, samples = np.indices(shape, dtype=np.float64)
    passed = np.ones(shape, np.float32)
    for x, y in marks_xy:
        rows, columns = (
            slice(max(round(at) - MARK_REACH_PX, 0), max(round(at) + MARK_REACH_PX + 1, 0)) for at in (y, x)
        )
        profile, _, _ = spot(samples[rows, columns] - x, lines[rows, columns] - y)
        passed[rows, columns] *= (1 - MARK_DEPTH * profile).astype(np.float32)
    return passed


def has_8_bits(camera: Camera) -> bool:
    """Whether the camera's raw files hold bytes."""
    return camera.saturation_dn == 255.0
