"""What a picture of a surface shows beside its shading: departures from the mean of the surroundings, in units of their
own scatter there."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from tasks.simulate import Scene
from tasks.simulate.pixels import detect
from tasks.simulate.window import Window

Image = NDArray[np.float32]

# Surroundings: Gaussian, 1-sigma, in pixels of the comparison. Wider ones leave shading in, narrower ones take the
# map's own markings out (see `closeup.settings`: a map pixel is about two pixels of the comparison).
SURROUNDINGS_PX = 8.0
# Cosines of incidence and emission below which nothing is compared: relief, which no map holds, rules there.
LEAST_COSINE = 0.15
# A pixel of the comparison needs so much of itself on such a surface.
FULL_SHARE = 0.98
# Pixels darker than this share of the frame's bright parts are sky or night.
DARK_SHARE = 0.08


class Texture(NamedTuple):
    """values: (ny, nx), 0 where not known (known: (ny, nx) bool)."""

    values: Image
    known: NDArray[np.bool_]


def texture_of(picture: NDArray[np.floating], known: NDArray[np.bool_]) -> Texture:
    """Departures of `picture` (ny, nx) from the mean of the known surroundings over their scatter about it."""
    weight = known.astype(np.float32)
    total = np.maximum(_around(weight), 1e-6)
    level = _around(np.where(known, picture, 0).astype(np.float32)) / total
    off = np.where(known, picture - level, 0).astype(np.float32)
    scatter = np.sqrt(np.maximum(_around(off**2) / total, 1e-20))
    return Texture(np.where(known, np.clip(off / scatter, -4, 4), 0).astype(np.float32), known)


def image_texture(observation: Observation) -> Texture:
    """The texture of an image, where it is neither sky nor night."""
    usable = observation.usable
    image = observation.image
    if not usable.any():
        return Texture(np.zeros(image.shape, np.float32), usable)
    dark, bright = np.percentile(image[usable], [1, 95])
    floor = min(float(dark), 0.0)
    return texture_of(image, usable & (image - floor > DARK_SHARE * (bright - floor)))


def map_texture(scene: Scene, pose: Pose, window: Window) -> Texture:
    """The texture of the base map as the camera sees it under `window`, where the surface is lit and not at a slant."""
    s = scene.oversample_for(pose)
    surface = scene.surface(pose, window, s)
    meant = (surface.mu0 > LEAST_COSINE) & (surface.mu > LEAST_COSINE)
    share = detect(meant.astype(np.float32), s, scene.psf_sigma_px)
    albedo = detect(np.where(meant, surface.albedo, 0).astype(np.float32), s, scene.psf_sigma_px)
    return texture_of(albedo / np.maximum(share, np.float32(1e-3)), share > FULL_SHARE)


def _around(values: Image) -> Image:
    import cv2

    blurred: Image = cv2.GaussianBlur(values, (0, 0), SURROUNDINGS_PX, borderType=cv2.BORDER_CONSTANT)
    return blurred
