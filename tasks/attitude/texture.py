"""What the image shows of markings: the lit disk without its shading, and how like it a map is at any orientation."""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from catalog.flips import PLACES, Flip
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.robust import huber_weight, sigma_about_zero
from tasks.compare.occulted import light_behind
from tasks.compare.reduce import reduced_observation, reduced_scene
from tasks.geometry.bilinear import values_towards
from tasks.project.points import body_points
from tasks.simulate import Scene
from tasks.simulate.coarse_map import map_as_coarse_as
from tasks.simulate.photometry import BASES
from tasks.simulate.window import Window, disk_radius_px, target_window

Array = NDArray[np.float64]

# So many lit pixels tell all that a test of markings needs; more are averaged.
ENOUGH_PX = 4000
# Markings are compared size by size, for the large ones would outvote the many small ones: Gaussian widths, pixels,
# between which the bands lie.
SIZES_PX = (0.7, 1.4, 2.8, 5.6)
# Pixels nearer to the limb than this and the blur's width are mixed with sky; near the terminator shading is unknown.
RIM_PX, DUSK = 1.0, 0.05
# Errors of photometric laws, relative; they grow towards the terminator.
LAW_ERROR = 0.03
FEWEST_PX = 24
ROUNDS, HUBER = 4, 3.0


@dataclass(frozen=True, eq=False)
class Texture:
    """points: (n, 3) directions in the body frame of `pose`, of pixels inside the lit disk. shading: (n,) brightness
    without markings. value: (n,) image less shading over its error; smooth: (n, k) orthonormal, what shading may be
    wrong by, which value has nothing of. weight: (n,) one over the error. likeness: correlation of image and shading.
    noise: share of the value's square that is noise. albedo: map at the pixels' size, its first column's left edge
    at left_edge_deg. pixel_deg: how far the body turns while its middle moves by a pixel. inside: (ny, nx) where the n
    pixels are. reduction: how many of the image's pixels one of these is wide. own: the image's markings by size, see
    `bands`."""

    points: Array
    shading: Array
    value: Array
    smooth: Array
    weight: Array
    likeness: float
    noise: float
    albedo: NDArray[np.float32]
    left_edge_deg: float
    pixel_deg: float
    inside: NDArray[np.bool_]
    reduction: int = 1

    @cached_property
    def own(self) -> list[Array]:
        """The image's markings by size."""
        return self.bands(self.value)

    @cached_property
    def filled(self) -> list[NDArray[np.float32]]:
        """How much of each Gaussian lies on the n pixels."""
        return [np.maximum(blurred(self.inside.astype(np.float32), size), 1e-3) for size in SIZES_PX]

    def bands(self, values: Array) -> list[Array]:
        """Values (n,) split into those of sizes between neighbouring ones of SIZES_PX, and larger (each (n,))."""
        plane = np.zeros(self.inside.shape, np.float32)
        plane[self.inside] = values
        means = [(blurred(plane, s) / full)[self.inside] for s, full in zip(SIZES_PX, self.filled, strict=True)]
        return [*(a - b for a, b in itertools.pairwise((values, *means))), means[-1]]

    def correlations(self, turn: Array) -> Array:
        """Correlation of the image's with the map's markings at `turn`, size by size."""
        found = []
        for own, other in zip(self.own, self.bands(self.of_map(turn)), strict=True):
            scale = float(np.sqrt((own @ own) * (other @ other)))
            found.append(float(own @ other) / scale if scale > 0 else 0.0)
        return np.array(found)

    def of_map(self, turn: Array) -> Array:
        """The map's markings (n,), as `value`, with the body turned by the rotation `turn` (3, 3) in its own frame."""
        column = self.shading * self.weight * (sampled(self.albedo, self.left_edge_deg, self.points @ turn) - 1.0)
        return np.asarray(column - self.smooth @ (self.smooth.T @ column))

    def correlation(self, turn: Array) -> tuple[float, float]:
        """Correlation of the image's with the map's markings at `turn`, and the contrast of the image's markings, the
        map's being 1."""
        column = self.of_map(turn)
        own, other = float(self.value @ self.value), float(column @ column)
        if own <= 0 or other <= 0:
            return 0.0, 0.0
        together = float(self.value @ column)
        return together / float(np.sqrt(own * other)), together / other


def texture_of(observation: Observation, pose: Pose, scene: Scene, flip: Flip | None = None) -> Texture | None:
    """The markings of the image under the disk of `pose`; None where too few lit pixels are usable.

    flip: how the picture is flipped about the disk's centre beforehand.
    """
    radius = disk_radius_px(pose, scene.camera, scene.target)
    lit = np.pi * radius**2 * (1 + np.cos(np.radians(pose.phase_deg))) / 2
    n = max(1, int(np.ceil(np.sqrt(lit / ENOUGH_PX))))
    observation, scene = reduced_observation(observation, n), reduced_scene(scene, n)
    radius = radius / n
    window = target_window(pose, scene.camera, scene.target)
    image, noise = (window.crop(a).astype(np.float64) for a in (observation.image, observation.noise))
    usable = window.crop(observation.usable, fill=False)
    centre = scene.camera.project(pose.target_in_camera_km) - (window.x0, window.y0)
    if flip is not None:
        image, noise, usable = flipped_about(image, noise, usable, centre, flip)
    xy, mu0, mu, points = surface_under(window, pose, scene)
    rim = RIM_PX + 1.5 * scene.psf_sigma_px
    inner = np.sqrt(max(1 - (1 - min(rim / radius, 0.9)) ** 2, 0.0))
    inside = usable & (mu > inner) & (mu0 > DUSK)
    if inside.sum() < FEWEST_PX:
        return None
    away = (xy - scene.camera.project(pose.target_in_camera_km)) / radius
    sky = usable & (np.hypot(away[..., 0], away[..., 1]) > 1 + (rim + 1.0) / radius)
    behind = light_behind(observation, pose, scene, window)
    level = float(np.median(image[sky])) if sky.sum() >= FEWEST_PX else 0.0
    level = level if behind is None else behind.dark
    laws = np.stack([law(mu0[inside], mu[inside], pose.phase_deg) for law in BASES["mixture"]], axis=1)
    seen, error = image[inside] - level, noise[inside]
    shading, weight = fitted_shading(laws.astype(np.float64), seen, error, mu0[inside])
    if shading is None:
        return None
    u, v = away[inside].T
    smooth = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1) * (shading * weight)[:, None]
    smooth = np.concatenate([smooth, laws * weight[:, None], weight[:, None]], axis=1)
    left, strength, _ = np.linalg.svd(smooth / np.maximum(np.linalg.norm(smooth, axis=0), 1e-12), full_matrices=False)
    smooth = left[:, strength > 1e-4 * strength[0]]
    value = (seen - shading) * weight
    value = value - smooth @ (smooth.T @ value)
    # A few bright dots would else be the markings.
    spread = sigma_about_zero(value)
    value = np.clip(value, -4 * spread, 4 * spread) if spread > 0 else value
    value = value - smooth @ (smooth.T @ value)
    expected = float(((error * weight) ** 2).sum()) * max(1 - smooth.shape[1] / len(value), 0.05)
    pixel_rad = 1 / max(radius, 1.0)
    albedo = map_as_coarse_as(scene.basemap, pixel_rad * max(1.0, 2 * scene.psf_sigma_px))
    mean = float(np.mean(sampled(albedo, scene.basemap.left_edge_deg, points[inside])))
    return Texture(
        points=points[inside],
        shading=shading,
        value=value,
        smooth=smooth,
        weight=weight,
        likeness=float(np.corrcoef(shading, seen)[0, 1]) if np.ptp(shading) > 0 else 0.0,
        noise=min(expected / max(float(value @ value), 1e-12), 1.0),
        albedo=(albedo / np.float32(max(mean, 1e-6))).astype(np.float32),
        left_edge_deg=scene.basemap.left_edge_deg,
        pixel_deg=float(np.degrees(pixel_rad)),
        inside=cut_to(inside),
        reduction=n,
    )


def cut_to(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The rows and columns between the first and the last that hold something."""
    y, x = np.nonzero(inside)
    return inside[y.min() : y.max() + 1, x.min() : x.max() + 1]


def blurred(plane: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    """Gaussian blur, nothing beyond the edges."""
    import cv2

    blur = cv2.GaussianBlur(plane, (0, 0), sigma_px, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(blur, np.float32)


def surface_under(window: Window, pose: Pose, scene: Scene) -> tuple[Array, Array, Array, Array]:
    """Of every pixel of the window: its place (ny, nx, 2), cosines of incidence and emission (ny, nx; 0 off the body
    and at night), and the direction (ny, nx, 3) of the surface point in the body frame."""
    y, x = np.mgrid[window.y0 : window.y1, window.x0 : window.x1]
    xy = np.stack([x, y], axis=-1).astype(np.float64)
    points = body_points(pose, scene.camera, scene.target, xy)
    normal = points / np.square(scene.target.radii_km)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    to_camera = pose.spacecraft_in_body_km - points
    to_camera /= np.linalg.norm(to_camera, axis=-1, keepdims=True)
    mu0 = np.nan_to_num(np.clip(normal @ pose.sun_direction_in_body, 0, 1))
    mu = np.nan_to_num(np.clip((normal * to_camera).sum(axis=-1), 0, 1))
    return xy, mu0, mu, points / np.linalg.norm(points, axis=-1, keepdims=True)


def fitted_shading(laws: Array, seen: Array, noise: Array, mu0: Array) -> tuple[Array | None, Array]:
    """Brightness (n,) by a sum of laws (n, k) of positive weights, and one over the error of each pixel (n,); None
    where the disk is not brighter than the sky."""
    from scipy.optimize import nnls

    error, weight = noise, 1 / np.maximum(noise, 1e-9)
    shading = np.zeros_like(seen)
    factor = np.ones_like(seen)
    for _ in range(ROUNDS):
        shading = laws @ nnls(laws * (weight * factor)[:, None], seen * weight * factor)[0]
        typical = float(np.median(shading))
        if typical <= 0:
            return None, weight
        error = np.sqrt(noise**2 + (LAW_ERROR * shading) ** 2 + (LAW_ERROR * DUSK / mu0 * typical) ** 2)
        weight = 1 / np.maximum(error, 1e-9)
        off = np.abs(seen - shading) * weight
        factor = np.sqrt(huber_weight(off, HUBER * max(sigma_about_zero(off), 1e-9)))
    return shading, weight * factor


def sampled(albedo: NDArray[np.float32], left_edge_deg: float, points: Array) -> Array:
    """Map value (n,) at directions (n, 3)."""
    return values_towards(albedo, left_edge_deg, points)


def flipped_about(
    image: Array, noise: Array, usable: NDArray[np.bool_], centre: Array, flip: Flip
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """The three planes (ny, nx) flipped about `centre` (2,), px: what a picture flipped so would show there."""
    import cv2

    ny, nx = image.shape
    y, x = np.mgrid[0:ny, 0:nx]
    # The picture as it should be has at p what this one has at the inverse of the flip, which is its transpose.
    there = np.stack([x - centre[0], y - centre[1]], axis=-1) @ PLACES[flip] + centre
    u, v = (there[..., k].astype(np.float32) for k in (0, 1))
    planes = [
        cv2.remap(plane.astype(np.float32), u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        for plane in (image, noise, usable)
    ]
    return planes[0].astype(np.float64), planes[1].astype(np.float64), planes[2] > 0.999
