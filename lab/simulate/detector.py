"""From a picture on the focal plane to the numbers that a detector would have sent."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera, Noise
from catalog.observation import Observation
from lab.simulate.cameras import DetectorHabits
from lab.simulate.optics import TrueOptics
from lab.simulate.picture import Picture
from tasks.simulate.window import Window
from tasks.undistort.mark_fit import spot

GRID_PX = 8
SPLINE_REACH_PX = 12
MARK_REACH_PX = 6
MARK_DEPTH = (0.9, 1.0)
COSMIC_RAY_DN = 0.25  # mean of the exponential distribution, fraction of saturation
GAP_LINES = 3
LARGEST_BYTE = 255.0

Array = NDArray[np.float64]
Image = NDArray[np.float32]


@dataclass(frozen=True)
class Recorded:
    """image float32 (ny, nx), DN as the file holds them; noise: 1-sigma of each pixel; saturated, missing: masks."""

    image: Image
    noise: Image
    saturated: NDArray[np.bool_]
    missing: NDArray[np.bool_]
    facts: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Exposure:
    """How one frame was taken. peak_dn: DN of the lit disk's bright parts; dark_dn: of the sky, middle and corners;
    cosmic_rays, spikes, gaps: mean numbers."""

    peak_dn: float
    dark_dn: tuple[float, float]
    noise: Noise
    cosmic_rays: float = 0.0
    spikes: float = 0.0
    gaps: float = 0.0


def usual_exposure(
    camera: Camera, habits: DetectorHabits, rng: np.random.Generator, overexposed_share: float = 0.06
) -> Exposure:
    """An exposure of a camera that is not quite as its file says (noise 0.8 to 1.25 times); a few are overexposed."""
    read, photon = np.exp(rng.uniform(-0.22, 0.22, 2))
    noise = camera.noise.model_copy(
        update={"read_dn": camera.noise.read_dn * read, "gain_e_per_dn": camera.noise.gain_e_per_dn * photon}
    )
    overexposed = rng.uniform() < overexposed_share and camera.saturation_dn is not None
    peak_dn = 1.05 * float(camera.saturation_dn or 0) if overexposed else float(rng.uniform(*habits.peak_dn))
    return Exposure(peak_dn, habits.dark_dn, noise, habits.cosmic_rays, habits.spikes, habits.gaps)


def clean_exposure(camera: Camera, habits: DetectorHabits) -> Exposure:
    """An exposure exactly as the camera's file describes it, with nothing but its noise."""
    middle = habits.dark_dn[0]
    return Exposure(float(np.mean(habits.peak_dn)), (middle, middle), camera.noise)


def raw_frame(picture: Picture, optics: TrueOptics) -> Image:
    """The picture (its peak at 1, sky 0) in the raw frame (ny, nx) of `optics`."""
    from scipy.ndimage import map_coordinates  # OpenCV's bicubic rounds places to 1/32 px

    columns, rows = optics.raw_size_px
    image = np.zeros((rows, columns), np.float32)
    part = _raw_window(picture.window, optics)
    if min(part.shape) < 1:
        return image
    grid = np.stack(np.meshgrid(np.arange(part.x0, part.x1), np.arange(part.y0, part.y1)), axis=-1)
    places = optics.undistort_points(grid.astype(np.float64)) - (picture.window.x0, picture.window.y0)
    values = map_coordinates(picture.brightness, np.moveaxis(places[..., ::-1], -1, 0), order=3, mode="constant")
    image[part.y0 : part.y1, part.x0 : part.x1] = np.maximum(np.nan_to_num(values), 0)
    return image


def _raw_window(window: Window, optics: TrueOptics) -> Window:
    """Raw pixels whose undistorted places are inside `window`, and some around them."""
    columns, rows = optics.raw_size_px
    raw = np.stack(np.meshgrid(np.arange(0, columns, GRID_PX), np.arange(0, rows, GRID_PX)), axis=-1)
    x, y = np.moveaxis(optics.undistort_points(raw.astype(np.float64)), -1, 0)
    reach = 2 * GRID_PX
    inside = (x > window.x0 - reach) & (x < window.x1 + reach) & (y > window.y0 - reach) & (y < window.y1 + reach)
    if not inside.any():
        return Window(0, 0, 0, 0)
    low, high = raw[inside].min(axis=0) - SPLINE_REACH_PX, raw[inside].max(axis=0) + SPLINE_REACH_PX
    return Window(int(low[0]), int(low[1]), int(high[0]) + 1, int(high[1]) + 1).clipped(optics.raw_size_px)


def exposed_frame(picture: Picture, optics: TrueOptics, camera: Camera, exposure: Exposure) -> tuple[Image, TrueOptics]:
    """The frame in DN, sky included, without marks and noise; and the optics, bent by this frame's brightness."""
    frame = _above_dark(raw_frame(picture, optics), exposure)
    if not optics.px_per_dn:
        return frame, optics
    nothing = np.zeros(frame.shape, np.uint16)
    bent = optics.bent_by(Observation(frame, np.ones_like(frame), nothing), camera.saturation_dn)
    return _above_dark(raw_frame(picture, bent), exposure), bent


def _above_dark(signal: Image, exposure: Exposure) -> Image:
    rows, columns = signal.shape
    y, x = np.mgrid[-1 : 1 : rows * 1j, -1 : 1 : columns * 1j]
    middle, corner = exposure.dark_dn
    dark = middle + (corner - middle) * (x * x + y * y) / 2
    return (dark + exposure.peak_dn * signal).astype(np.float32)


def recorded(
    frame: Image, camera: Camera, exposure: Exposure, rng: np.random.Generator, marks_xy: Array | None = None
) -> Recorded:
    """What `camera` sends of a noise-free raw `frame` (ny, nx), DN: reseau marks at `marks_xy` (n, 2), noise, cosmic
    rays, telemetry errors, saturation, whole numbers if its files have 8 bits, missing lines (zeros)."""
    signal = frame if marks_xy is None else frame * let_through(frame.shape, marks_xy, rng)
    model = exposure.noise
    noise = np.sqrt(model.read_dn**2 + np.maximum(signal, 0) / model.gain_e_per_dn + (model.relative * signal) ** 2)
    image = signal + noise * rng.standard_normal(frame.shape, dtype=np.float32)
    rays = _add_cosmic_rays(image, exposure.cosmic_rays, camera.saturation_dn or float(frame.max()), rng)
    spikes = _add_spikes(image, exposure.spikes, rng)
    saturated = np.zeros(frame.shape, bool)
    if camera.saturation_dn is not None:
        saturated = image >= camera.saturation_dn
        image = np.minimum(image, camera.saturation_dn)
    if has_8_bits(camera):
        image = np.clip(np.rint(image), 0, LARGEST_BYTE)
    missing, lines = _gaps(frame.shape, exposure.gaps, rng)
    image = np.where(missing, 0, image)
    facts = {
        "peak_dn": exposure.peak_dn,
        "dark_dn": list(exposure.dark_dn),
        "noise": model.model_dump(),
        "cosmic_rays": rays,
        "spikes": spikes,
        "missing_lines": lines,
        "saturated_px": int(saturated.sum()),
    }
    return Recorded(image.astype(np.float32), noise.astype(np.float32), saturated & ~missing, missing, facts)


def let_through(shape: tuple[int, ...], marks_xy: Array, rng: np.random.Generator | None = None) -> NDArray[np.float32]:
    """Fraction of the light (ny, nx) that passes the marks, with the profile that real marks were measured to have."""
    lines, samples = np.indices(shape, dtype=np.float64)
    passed = np.ones(shape, np.float32)
    depths = np.full(len(marks_xy), MARK_DEPTH[0]) if rng is None else rng.uniform(*MARK_DEPTH, len(marks_xy))
    for (x, y), depth in zip(marks_xy, depths, strict=True):
        rows, columns = (
            slice(max(round(at) - MARK_REACH_PX, 0), max(round(at) + MARK_REACH_PX + 1, 0)) for at in (y, x)
        )
        profile, _, _ = spot(samples[rows, columns] - x, lines[rows, columns] - y)
        passed[rows, columns] *= (1 - depth * profile).astype(np.float32)
    return passed


def _add_cosmic_rays(image: Image, mean_number: float, full_dn: float, rng: np.random.Generator) -> int:
    """Tracks of 1 to 4 pixels in any direction."""
    number = int(rng.poisson(mean_number))
    rows, columns = image.shape
    for _ in range(number):
        x, y, angle = rng.uniform(0, columns), rng.uniform(0, rows), rng.uniform(0, 2 * np.pi)
        bright = rng.exponential(COSMIC_RAY_DN * full_dn)
        for step in range(1 + int(rng.geometric(0.5)) % 4):
            column, row = int(x + step * np.cos(angle)), int(y + step * np.sin(angle))
            if 0 <= column < columns and 0 <= row < rows:
                image[row, column] += bright
    return number


def _add_spikes(image: Image, mean_number: float, rng: np.random.Generator) -> int:
    number = int(rng.poisson(mean_number))
    rows, columns = image.shape
    image[rng.integers(0, rows, number), rng.integers(0, columns, number)] = rng.uniform(0, LARGEST_BYTE, number)
    return number


def _gaps(
    shape: tuple[int, ...], mean_number: float, rng: np.random.Generator
) -> tuple[NDArray[np.bool_], list[list[int]]]:
    """Groups of lines that did not arrive, half of them from some sample onward: mask, and [line, lines, sample]."""
    missing = np.zeros(shape, bool)
    groups = []
    for _ in range(int(rng.poisson(mean_number))):
        line, lines = int(rng.integers(0, shape[0])), int(rng.integers(1, GAP_LINES + 1))
        sample = int(rng.integers(0, shape[1])) if rng.uniform() < 0.5 else 0
        missing[line : line + lines, sample:] = True
        groups.append([line, lines, sample])
    return missing, groups


def has_8_bits(camera: Camera) -> bool:
    """Whether the camera's raw files hold bytes."""
    return camera.saturation_dn == LARGEST_BYTE
