"""The light of a body behind the target, which the target hides: a moon in front of its planet.

A background that is added to the disk is wrong there: the target, its night side too, takes away what is behind it,

    image = dark level + behind (1 - coverage) + disk.

What is behind is the image itself some pixels beyond the limb, continued over the disk. There it explains every pixel
and says nothing of the target; between there and the limb it is a prediction, and is tested.
"""

import weakref
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.observation import UNUSABLE, Observation, Quality
from catalog.pose import Pose
from tasks.compare.sky import is_uneven_sky
from tasks.project.curves import limb
from tasks.simulate import Scene
from tasks.simulate.window import Window, disk_radius_px, target_window

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Beyond the limb the image is what is behind from so many pixels on, and from so much of the disk's radius and of the
# blur's width.
GAP_PX, GAP_RADII, GAP_SIGMAS = 2.5, 0.05, 2.0
# Light behind is looked for in a rim of so many pixels beyond that, and counts when so much of the rim has it.
RIM_PX, LEAST_OF_RIM = 6.0, 0.1
# Levels of the frame are of cells of at most so many pixels, a quarter of the radius: single pixels are noise.
CELL_PX, CELL_RADII = 8, 0.25
LIMB_POINTS = 360
# Levels of the frame: per cent of the cells. The dark side of a moon may be all that is dark. Bright is what such a
# share of the target's disk exceeds, where that is less: a small disk in a large frame is no half per cent of it, and
# the sky's noise would be what is bright, and the light that the optics scatter around the disk a body behind it.
DARK_PERCENT, BRIGHT_PERCENT, BRIGHT_OF_DISK = 0.2, 99.5, 0.25
# A rim that is brighter than the dark level by fewer sigmas of a cell's mean is dark.
NOISE_SIGMAS = 6.0
SWEEPS = 24
# The night side: within so much of the radius, the Sun's height below minus so much of its sine; so many pixels tell.
INSIDE, BELOW, LEAST_OF_NIGHT = 0.85, 0.2, 12


@dataclass(frozen=True)
class Occulted:
    """light: (ny, nx) of what is behind the target, above the frame's dark level, continued over the disk. near: (ny,
    nx) the disk and its surroundings in which `light` is a prediction; elsewhere it is the image itself. sigma: (ny,
    nx) how far off the prediction may be near the limb, 1-sigma, by what the image changes beyond it: where the edge of
    the body behind passes, much. dark: the level. unclear: sigma from which the light is not known.
    """

    light: Image
    near: Mask
    sigma: Image
    dark: float
    unclear: float

    @property
    def clear(self) -> Mask:
        """(ny, nx) where the light is known."""
        return np.asarray(self.sigma < self.unclear, np.bool_)

    @property
    def most(self) -> float:
        """By what factor more than `light` may be hidden: where no sky is in the frame its dark level is light, too."""
        typical = float(np.median(self.light[self.near])) if self.near.any() else 0.0
        return 1 + max(self.dark, 0.0) / typical if typical > 0 else 1.0


def light_behind(observation: Observation, pose: Pose, scene: Scene, window: Window) -> Occulted | None:
    """What is behind the target at `pose`, under `window`; None where its surroundings are dark (see
    `SceneSettings.behind_share`), which nearly all images are, or bright by an uneven sky that the target's night side
    does not hide."""
    share = scene.settings.behind_share
    if share is None:
        return None
    radius = disk_radius_px(pose, scene.camera, scene.target)
    gap = GAP_PX + GAP_RADII * radius + GAP_SIGMAS * scene.psf_sigma_px
    around = rim_window(pose, scene, gap + RIM_PX + 1)
    usable = (around.crop(observation.quality, fill=int(Quality.MISSING)) & UNUSABLE) == 0
    outside = distance_from_disk(pose, scene, around)
    rim = usable & (outside > gap) & (outside <= gap + RIM_PX)
    if not rim.any():
        return None
    dark, limit = levels(observation, radius, share)
    image = around.crop(observation.image)
    if bright_share(image, usable, rim, limit) < LEAST_OF_RIM:
        return None
    night = usable & night_side(pose, scene, around)
    if not is_hidden(image, night, rim, dark) and is_uneven_sky(observation):
        return None
    known, smooth = usable & (outside > gap), without_single_pixels(image, usable)
    light = continued(smooth, known) - np.float32(dark)
    near = outside <= gap
    sigma = np.where(near, scatter_near(smooth, known, gap), 0).astype(np.float32)
    here = window.moved(-around.x0, -around.y0)
    return Occulted(here.crop(light), here.crop(near, fill=False), here.crop(sigma), dark, limit - dark)


def night_side(pose: Pose, scene: Scene, window: Window) -> Mask:
    """Pixels (ny, nx) well inside the disk on which the Sun is well below the horizon, the body taken for a sphere."""
    radius = disk_radius_px(pose, scene.camera, scene.target)
    x0, y0 = scene.camera.project(pose.target_in_camera_km) - (window.x0, window.y0)
    ny, nx = window.shape
    y, x = np.mgrid[:ny, :nx]
    across, down = (x - x0) / radius, (y - y0) / radius
    square = across**2 + down**2
    sun = pose.camera_from_j2000 @ pose.sun_from_target_km
    height = across * sun[0] + down * sun[1] - np.sqrt(np.maximum(1 - square, 0)) * sun[2]
    return np.asarray((square < INSIDE**2) & (height < -BELOW * np.linalg.norm(sun)), np.bool_)


def is_hidden(image: Image, night: Mask, rim: Mask, dark: float) -> bool:
    """Whether the target's night side is darker than half of the light beside it, or too little of it is seen to
    tell."""
    if np.count_nonzero(night) < LEAST_OF_NIGHT:
        return True
    return float(np.median(image[night])) - dark < (float(np.median(image[rim])) - dark) / 2


def scatter_near(image: Image, known: Mask, gap_px: float) -> Image:
    """Standard deviation (ny, nx) of the known pixels about each pixel, as far away as the limb is from them; 0 where
    there are none."""
    import cv2

    side = 2 * int(np.ceil(gap_px + 1)) + 1
    middle = np.float32(image[known].mean())
    value = np.where(known, image - middle, 0).astype(np.float32)
    count, first, second = (
        cv2.blur(plane, (side, side), borderType=cv2.BORDER_CONSTANT)
        for plane in (known.astype(np.float32), value, value * value)
    )
    count = np.maximum(count, np.float32(1e-6))
    return np.sqrt(np.maximum(second / count - (first / count) ** 2, 0))


def rim_window(pose: Pose, scene: Scene, margin_px: float) -> Window:
    """The target's window with a margin, without what lies outside the frame."""
    return target_window(pose, scene.camera, scene.target, margin_px).clipped(scene.camera.size_px)


def distance_from_disk(pose: Pose, scene: Scene, window: Window) -> Image:
    """Distance (ny, nx) of each pixel from the disk, pixels; 0 inside."""
    import cv2

    if min(window.shape) < 1:
        return np.zeros(window.shape, np.float32)
    xy = limb(pose, scene.camera, scene.target, LIMB_POINTS).xy_px - (window.x0, window.y0)
    off = np.ones(window.shape, np.uint8)
    cv2.fillPoly(off, [np.rint(xy[np.isfinite(xy).all(axis=1)]).astype(np.int32)], 0)
    return np.asarray(cv2.distanceTransform(off, cv2.DIST_L2, 3), np.float32)


def levels(observation: Observation, radius_px: float, share: float) -> tuple[float, float]:
    """The frame's dark level, and the level above which it is bright."""
    n = int(np.clip(CELL_RADII * radius_px, 1, CELL_PX))
    of_disk = 100 * (1 - BRIGHT_OF_DISK * np.pi * radius_px**2 / observation.image.size)
    key = n, max(BRIGHT_PERCENT, round(of_disk, 3))
    known = _known.get(id(observation.image))
    if known is None or known[0]() is not observation.image:
        # A loop comes again and again with the same image; one that is gone is forgotten.
        for gone in [place for place, (image, _) in list(_known.items()) if image() is None]:
            _known.pop(gone, None)
        known = _known[id(observation.image)] = (weakref.ref(observation.image), {})
    if key not in known[1]:
        known[1][key] = cell_levels(observation, *key)
    dark, bright, noise = known[1][key]
    return dark, dark + max(share * (bright - dark), NOISE_SIGMAS * noise)


_known: dict[int, tuple[weakref.ref[Image], dict[tuple[int, float], tuple[float, float, float]]]] = {}


def cell_levels(observation: Observation, n: int, bright_percent: float) -> tuple[float, float, float]:
    """Darkest and brightest level of the frame in means of n x n pixels, and their noise."""
    import cv2

    ny, nx = (size // n for size in observation.image.shape)
    usable = observation.usable
    whole, filled = (
        cv2.resize(plane[: ny * n, : nx * n], (nx, ny), interpolation=cv2.INTER_AREA)
        for plane in (np.where(usable, observation.image, 0).astype(np.float32), usable.astype(np.float32))
    )
    enough = filled > 0.5
    if not enough.any():
        return 0.0, np.inf, 0.0
    dark, bright = np.percentile(whole[enough] / filled[enough], [DARK_PERCENT, bright_percent])
    noise = float(np.nanmedian(np.where(usable[::n, ::n], observation.noise[::n, ::n], np.nan)))
    return float(dark), float(bright), noise / n if np.isfinite(noise) else 0.0


def bright_share(image: Image, usable: Mask, rim: Mask, limit: float) -> float:
    """Part of the rim (ny, nx) whose 3 x 3 means exceed the limit."""
    import cv2

    weight = cv2.blur(usable.astype(np.float32), (3, 3))
    mean = cv2.blur(np.where(usable, image, 0).astype(np.float32), (3, 3)) / np.maximum(weight, np.float32(1e-3))
    return float((mean[rim] > limit).mean())


def without_single_pixels(image: Image, usable: Mask) -> Image:
    """Median of 5 x 5 pixels, where all is usable."""
    import cv2

    smooth = cv2.medianBlur(np.ascontiguousarray(image, np.float32), 5)
    return np.where(cv2.erode(usable.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0, smooth, image)


def continued(image: Image, known: Mask) -> Image:
    """The image (ny, nx) where it is known, and elsewhere what leads evenly from one side to the other: a solution of
    Laplace's equation, coarse to fine, edges of the frame reflecting."""
    import cv2

    ny, nx = image.shape
    if known.all() or min(ny, nx) < 2:
        return np.where(known, image, image[known].mean() if known.any() else 0).astype(np.float32)
    rows, columns = (ny + 1) // 2, (nx + 1) // 2
    padded = ((0, 2 * rows - ny), (0, 2 * columns - nx))
    weight = np.pad(known, padded).astype(np.float32).reshape(rows, 2, columns, 2).sum(axis=(1, 3))
    total = np.pad(np.where(known, image, 0), padded).reshape(rows, 2, columns, 2).sum(axis=(1, 3))
    coarse = continued((total / np.maximum(weight, 1)).astype(np.float32), weight > 0)
    fine = cv2.resize(coarse, (2 * columns, 2 * rows), interpolation=cv2.INTER_LINEAR)[:ny, :nx]
    out = np.where(known, image, fine).astype(np.float32)
    four = np.array([[0, 0.25, 0], [0.25, 0, 0.25], [0, 0.25, 0]], np.float32)
    for _ in range(SWEEPS):
        mean = cv2.filter2D(out, cv2.CV_32F, four, borderType=cv2.BORDER_REPLICATE)
        np.copyto(out, mean, where=~known)
    return out


def finer(image: Image, oversample: int) -> Image:
    """An image (ny, nx) at s x s sub-pixels per pixel (ny*s, nx*s), linear between the pixels' middles."""
    import cv2

    ny, nx = image.shape
    size = (nx * oversample, ny * oversample)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_LINEAR), np.float32)
