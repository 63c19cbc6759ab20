"""A picture of stars, a disk and detector faults, drawn from directions: a pinhole written out, star images integrated
over the pixels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from catalog.camera import Camera
from catalog.observation import Observation, Quality

Array = NDArray[np.float64]
READ_NOISE = 2.0
SKY = 12.0
SATURATED = 60_000.0


@dataclass(frozen=True)
class Faults:
    """How many there are of what is no star. disk: radius as a share of the frame's side, 0 for none."""

    hot_pixels: int = 0
    cosmic_rays: int = 0
    disk: float = 0.0


def height_of(signal_to_noise: float, psf_px: float) -> float:
    """Height of a Gaussian star image that a matched filter sees with this signal to noise."""
    return signal_to_noise * READ_NOISE / (np.sqrt(np.pi) * psf_px)


def places_of(camera: Camera, camera_from_j2000: Array, directions: Array) -> Array:
    """Raw pixels (n, 2) of directions (n, 3); NaN behind the camera. The pinhole is written out here; the distortion is
    the camera file's."""
    v = directions @ camera_from_j2000.T
    with np.errstate(divide="ignore", invalid="ignore"):
        x = camera.focal_length_px * v[:, 0] / v[:, 2] + camera.centre_px[0]
        y = camera.focal_length_px * v[:, 1] / v[:, 2] + camera.centre_px[1]
    places = np.where(v[:, 2:] > 0.1, np.stack([x, y], axis=-1), np.nan)
    return places if is_undistorted(camera) else camera.detector_pixel(v)


def is_undistorted(camera: Camera) -> bool:
    """Whether frames of this camera are made in its undistorted geometry: those whose distortion each frame's own marks
    tell."""
    return camera.distortion.model == "reseau"


def frame_of(
    camera: Camera, places: Array, heights: Array, psf_px: float, faults: Faults, random: np.random.Generator
) -> Observation:
    """The picture: stars at raw pixels (n, 2) of heights (n,), sky with a slope, faults, read and photon noise."""
    nx, ny = camera.size_px if is_undistorted(camera) else camera.detector_size_px
    slope = random.normal(0, 3.0, 2)
    picture = SKY + slope[0] * np.arange(nx) / nx + slope[1] * np.arange(ny)[:, None] / ny
    picture = picture + star_picture((ny, nx), places, heights, psf_px)
    if faults.disk:
        _cover_by_disk(picture, faults.disk, psf_px, random)
    picture = picture + random.normal(0, 1, picture.shape) * np.sqrt(READ_NOISE**2 + np.maximum(picture - SKY, 0) / 50)
    _spoil(picture, faults, random)
    quality = np.where(picture > SATURATED, int(Quality.SATURATED), 0).astype(np.uint16)
    noise = np.full(picture.shape, READ_NOISE, np.float32)
    return Observation(picture.astype(np.float32), noise, quality)


def star_picture(shape: tuple[int, int], places: Array, heights: Array, psf_px: float) -> Array:
    """Light (ny, nx) of stars at pixels (n, 2), of heights (n,), integrated over the pixels."""
    ny, nx = shape
    picture = np.zeros(shape)
    for place, height in zip(places, heights, strict=True):
        if np.isfinite(place).all() and -5 < place[0] < nx + 5 and -5 < place[1] < ny + 5:
            _add_star(picture, place, height, psf_px)
    return picture


def _add_star(picture: Array, place: Array, height: float, psf_px: float) -> None:
    ny, nx = picture.shape
    reach = int(np.ceil(6 * psf_px)) + 1
    spans = []
    for at, size in ((place[0], nx), (place[1], ny)):
        first, last = max(0, round(at) - reach), min(size, round(at) + reach + 1)
        edges = (np.arange(first, last + 1) - 0.5 - at) / (np.sqrt(2) * psf_px)
        spans.append((first, last, np.diff(erf(edges)) / 2))
    (x0, x1, along_x), (y0, y1, along_y) = spans
    if x1 > x0 and y1 > y0:
        picture[y0:y1, x0:x1] += height * 2 * np.pi * psf_px**2 * np.outer(along_y, along_x)


def _cover_by_disk(picture: Array, share: float, psf_px: float, random: np.random.Generator) -> None:
    """A lit disk before a part of the sky: a half-lit one with a soft limb, brighter than all stars."""
    ny, nx = picture.shape
    radius = share * min(nx, ny)
    cx, cy = random.uniform(0, nx), random.uniform(0, ny)
    rows, columns = (
        slice(max(0, int(at - radius)), min(size, int(at + radius) + 2)) for at, size in ((cy, ny), (cx, nx))
    )
    y, x = np.ogrid[rows, columns]
    u, v = (x - cx) / radius, (y - cy) / radius
    height = np.sqrt(np.clip(1 - u**2 - v**2, 0, 1))
    towards = random.normal(0, 1, 3)
    towards /= np.linalg.norm(towards)
    lit = np.clip(u * towards[0] + v * towards[1] + height * abs(towards[2]), 0, 1)
    texture = 1 + 0.2 * np.sin(7 * u + random.uniform(0, 6)) * np.sin(9 * v)
    away = np.hypot(x - cx, y - cy)
    light = SKY + 3000.0 * lit * texture * np.clip((radius - away) / psf_px, 0, 1)
    picture[rows, columns] = np.where(away < radius, light, picture[rows, columns])


def _spoil(picture: Array, faults: Faults, random: np.random.Generator) -> None:
    ny, nx = picture.shape
    for _ in range(faults.hot_pixels):
        picture[random.integers(ny), random.integers(nx)] += random.exponential(150.0) + 20
    for _ in range(faults.cosmic_rays):
        at, angle = random.uniform(0, [nx, ny]), random.uniform(0, np.pi)
        length, height = random.exponential(4.0), random.exponential(150.0) + 20
        for step in np.arange(0, length + 0.5, 0.5):
            x, y = np.rint(at + step * np.array([np.cos(angle), np.sin(angle)])).astype(int)
            if 0 <= x < nx and 0 <= y < ny:
                picture[y, x] += height / 2
