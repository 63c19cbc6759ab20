"""How uncertain the brightness of each pixel of a cube is: its noise, and what an error of its place does to it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.observation import UNUSABLE, Quality
from catalog.readers.noise import measured_noise
from tasks.export.source import Source

Image = NDArray[np.float32]
FEWEST_PIXELS = 200


@dataclass(frozen=True)
class BrightnessErrors:
    """1-sigma (ny, nx) of the cube's image, in its unit. noise: of a pixel alone; pose: where the place of the pixel on
    the ground is off by its uncertainty (brightness gradient times displacement), 0 where that is unknown."""

    noise: Image
    pose: Image


def brightness_errors(source: Source) -> BrightnessErrors:
    """Errors of the product's pixels. The noise is measured from the body's own pixels, as a cube may be calibrated to
    any unit; where it shows too few of them, from the whole frame."""
    quality, image = source.cube["quality"].values, source.cube["image"].values
    finite = np.isfinite(image)
    usable = ((quality & np.uint16(UNUSABLE)) == 0) & finite
    disk = usable & ((quality & np.uint16(Quality.OFF_BODY | Quality.LIMB | Quality.NIGHT_SIDE)) == 0)
    chosen = disk if disk.sum() >= FEWEST_PIXELS else usable
    known = np.where(finite, image, 0).astype(np.float32)
    return BrightnessErrors(measured_noise(known, chosen, False), _pose_part(source, known, usable))


def _pose_part(source: Source, image: Image, usable: NDArray[np.bool_]) -> Image:
    cube, radius_km = source.cube, source.target.mean_radius_km
    latitude = np.radians(cube["latitude"].values)
    with np.errstate(invalid="ignore"):
        north = np.radians(cube["latitude_uncertainty"].values)
        east = np.radians(cube["longitude_uncertainty"].values) * np.cos(latitude)
        pixel_km = cube["resolution_km"].values * np.cos(np.radians(cube["emission"].values))
        displacement = radius_km * np.hypot(north, east) * np.cos(np.radians(cube["emission"].values))
        moved_px = displacement / np.maximum(pixel_km, 1e-9) / np.sqrt(2)
        steepness = gradient(image, usable)
        return np.nan_to_num(moved_px * steepness).astype(np.float32)


def gradient(image: Image, usable: NDArray[np.bool_]) -> Image:
    """Size of the brightness gradient per pixel (ny, nx), of a lightly smoothed image; 0 beside unusable pixels."""
    import cv2

    filled = np.where(usable, image, 0).astype(np.float32)
    smooth = cv2.GaussianBlur(filled, (0, 0), 1.0)
    weight = cv2.GaussianBlur(usable.astype(np.float32), (0, 0), 1.0)
    rows, columns = np.gradient(smooth / np.maximum(weight, 1e-3))
    inner = cv2.erode(usable.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.where(inner, np.hypot(rows, columns), 0).astype(np.float32)
