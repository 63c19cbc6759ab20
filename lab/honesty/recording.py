"""What spoils a picture between detector and file: lost data, coarse values, added light, moved lines. Plain numpy."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BLOCK_PX = 8
GHOST_SHIFT = (0.4, 0.25)  # of the radius


@dataclass(frozen=True)
class Recorded:
    """A picture before its fault. raw: (rows, columns) in DN; a fault may write into it. size: how strong the fault is.
    full: the DN at which the detector is full. place, radius: of the target's disk, (x, y) and px."""

    raw: Array
    size: float
    full: float
    place: tuple[float, float]
    radius: float
    random: np.random.Generator


Fault = Callable[[Recorded], Array]
FAULTS: dict[str, Fault] = {}


def fault(function: Fault) -> Fault:
    """Register a fault by its function's name."""
    FAULTS[function.__name__.replace("_", "-")] = function
    return function


def spoiled(seen: Recorded, name: str) -> NDArray[np.int16]:
    """The picture with a fault of FAULTS, its values within 0 and `full`. Raises KeyError for an unknown name."""
    return np.clip(np.round(FAULTS[name](seen)), 0, seen.full).astype(np.int16)


@fault
def zero_filled(seen: Recorded) -> Array:
    """Zeros from the frame's upper left corner to `size` radii above and left of the disk's centre."""
    x, y = (max(int(middle - seen.size * seen.radius), 0) for middle in seen.place)
    seen.raw[:y, :x] = 0
    return seen.raw


@fault
def few_levels(seen: Recorded) -> Array:
    """Values of `size` bits."""
    step = (seen.full + 1) / 2**seen.size
    return np.floor(seen.raw / step) * step + step / 2


@fault
def blocks(seen: Recorded) -> Array:
    """Compressed in blocks of 8 px by the cosine transform, its coefficients in steps of `size` of the full scale that
    grow with frequency, as JPEG's do."""
    from scipy.fft import dctn, idctn

    rows, columns = (side - side % BLOCK_PX for side in seen.raw.shape)
    cells = seen.raw[:rows, :columns].reshape(rows // BLOCK_PX, BLOCK_PX, columns // BLOCK_PX, BLOCK_PX)
    frequency = np.add.outer(np.arange(BLOCK_PX), np.arange(BLOCK_PX))
    steps = (seen.size * seen.full * (1 + frequency))[None, :, None, :]
    kept = np.round(dctn(cells, axes=(1, 3), norm="ortho") / steps) * steps
    seen.raw[:rows, :columns] = idctn(kept, axes=(1, 3), norm="ortho").reshape(rows, columns)
    return seen.raw


@fault
def stray_light(seen: Recorded) -> Array:
    """Light that grows evenly across the frame, to `size` of the picture's peak."""
    angle = seen.random.uniform(0, 2 * np.pi)
    y, x = np.mgrid[: seen.raw.shape[0], : seen.raw.shape[1]]
    run = np.cos(angle) * x + np.sin(angle) * y
    return seen.raw + seen.size * np.percentile(seen.raw, 99.5) * (run - run.min()) / np.ptp(run)


@fault
def halo(seen: Recorded) -> Array:
    """Light scattered over 0.3 of the disk's radius: `size` of it."""
    from scipy.ndimage import gaussian_filter

    return (1 - seen.size) * seen.raw + seen.size * gaussian_filter(seen.raw, 0.3 * seen.radius)


@fault
def ghost(seen: Recorded) -> Array:
    """A second picture by reflection, `size` as bright and displaced by half a radius."""
    from scipy.ndimage import shift

    dx, dy = (part * seen.radius for part in GHOST_SHIFT)
    return seen.raw + seen.size * shift(seen.raw - np.median(seen.raw), (dy, dx), order=1)


@fault
def bright_columns(seen: Recorded) -> Array:
    """`size` of the columns raised by a tenth to a half of the full scale."""
    which = np.flatnonzero(seen.random.uniform(size=seen.raw.shape[1]) < seen.size)
    seen.raw[:, which] += seen.random.uniform(0.1, 0.5, size=which.size) * seen.full
    return seen.raw


@fault
def line_jitter(seen: Recorded) -> Array:
    """Each line displaced along itself by a normal draw of `size` px."""
    columns = np.arange(seen.raw.shape[1])
    moves = seen.size * np.asarray(seen.random.normal(size=len(seen.raw)))
    return np.stack([np.interp(columns - move, columns, line) for move, line in zip(moves, seen.raw, strict=True)])


@fault
def cosmic_rays(seen: Recorded) -> Array:
    """Tracks of 1 to 12 px; `size` is the number of tracks per pixel."""
    rows, columns = seen.raw.shape
    for _ in range(int(seen.random.poisson(seen.size * seen.raw.size))):
        x, y, angle = seen.random.uniform(0, columns), seen.random.uniform(0, rows), seen.random.uniform(0, np.pi)
        run = np.arange(seen.random.integers(1, 13))
        i = np.clip(np.round(y + run * np.sin(angle)).astype(int), 0, rows - 1)
        j = np.clip(np.round(x + run * np.cos(angle)).astype(int), 0, columns - 1)
        seen.raw[i, j] += seen.random.uniform(0.1, 1.0) * seen.full
    return seen.raw


@fault
def dropped_lines(seen: Recorded) -> Array:
    """`size` of the lines are the line above once more."""
    for line in np.flatnonzero(seen.random.uniform(size=seen.raw.shape[0]) < seen.size).tolist():
        seen.raw[line] = seen.raw[max(line - 1, 0)]
    return seen.raw


@fault
def lines_left_out(seen: Recorded) -> Array:
    """From the disk's centre on, the picture stands `size` lines too high: so many were left out."""
    lost, from_line = round(seen.size), int(seen.place[1])
    seen.raw[from_line:-lost] = seen.raw[from_line + lost :].copy()
    return seen.raw


@fault
def knee(seen: Recorded) -> Array:
    """Bright values compressed: above `size` of the peak they approach the peak exponentially."""
    peak = np.percentile(seen.raw, 99.9)
    start = seen.size * peak
    above = np.clip(seen.raw - start, 0, None)
    return np.where(seen.raw > start, start + (peak - start) * -np.expm1(-above / (peak - start)), seen.raw)


@fault
def clipped(seen: Recorded) -> Array:
    """Clipped at `size` of the peak, below what the camera file gives as full."""
    return np.minimum(seen.raw, seen.size * np.percentile(seen.raw, 99.9))


@fault
def two_gains(seen: Recorded) -> Array:
    """Two amplifiers: right of the disk's centre values are higher by the share `size`."""
    seen.raw[:, int(seen.place[0]) :] *= 1 + seen.size
    return seen.raw


@fault
def sharpened(seen: Recorded) -> Array:
    """Unsharp mask of 2 px, `size` strong."""
    from scipy.ndimage import gaussian_filter

    return seen.raw + seen.size * (seen.raw - gaussian_filter(seen.raw, 2.0))


@fault
def stretched(seen: Recorded) -> Array:
    """Columns farther apart than lines by the share `size`, about the disk's centre: pixels that are not square."""
    columns = np.arange(seen.raw.shape[1])
    source = seen.place[0] + (columns - seen.place[0]) / (1 + seen.size)
    return np.stack([np.interp(source, columns, line) for line in seen.raw])


@fault
def wrapped(seen: Recorded) -> Array:
    """Values above `size` of the peak begin at nothing again, as an overflow makes them."""
    return np.asarray(np.mod(seen.raw, seen.size * np.percentile(seen.raw, 99.9)))
