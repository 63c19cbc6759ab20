"""The image as a function of the unknowns, linearised at one state from one rendering of its geometry.

image = (1 + gain) PSF * (sum_k c_k albedo f_k + sum_l d_l f_l) + background. The weights c, d, the tiles' gains and the
background are linear; of the others the derivatives follow from the rendered geometry: a disk that moves, grows or is
rolled carries its image along, a body that is turned changes the albedo under each pixel.

In front of a bright body the image is taken without that body's light, and the disk takes it away where it covers it:
one more basis, whose weight is 1 where the light is wholly behind the target (see `tasks.compare.occulted`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from tasks.compare.occulted import finer
from tasks.joint.derivatives import changes_of_place, trail_columns
from tasks.joint.parameters import ATTITUDE, NAMES, State
from tasks.joint.problem import Problem
from tasks.joint.surface import FineSurface, fine_surface
from tasks.joint.tiles import Tiles
from tasks.simulate import Scene
from tasks.simulate.photometry import Law, laws
from tasks.simulate.pixels import detect
from tasks.simulate.shine import cosines_of, shines_of, with_shines
from tasks.simulate.trail import smeared
from tasks.simulate.window import Window, disk_radius_px

Image = NDArray[np.float32]


@dataclass(frozen=True)
class Model:
    """The rendered surface at `state` under `window`, and the images that do not depend on the linear weights.

    shades: what the laws, mapped ones first, then plain ones, make of the sub-pixels without the map. bases: (k, ny,
    nx), of these laws, the last `hides` (0 or 1) of them what the disk takes away of light behind it; sharp: the same
    before the smear along the state's trail. by_sun: for each of two turns of the Sun's direction, what the shades
    change by per degree; () where sun_deg, its 1-sigma, is 0. background: (b, ny, nx). centre_px: target's centre in
    the window.
    """

    state: State
    window: Window
    oversample: int
    surface: FineSurface
    shades: list[Image]
    mapped: int
    bases: Image
    sharp: Image
    background: Image
    coverage: Image
    mu0: Image
    centre_px: NDArray[np.float64]
    tiles: Tiles
    wings_px: tuple[float, ...]
    hides: int = 0
    by_sun: tuple[list[Image], ...] = ()
    sun_deg: float = 0.0

    def brightness(self, weights: NDArray) -> Image:
        """The disk without gains and background, by the bases' weights (k,)."""
        laws = len(self.bases) - self.hides
        return np.tensordot(np.asarray(weights[:laws], np.float32), self.bases[:laws], 1)

    def picture(self, weights: NDArray) -> Image:
        """The same with what the disk takes away of light behind it."""
        return np.tensordot(np.asarray(weights, np.float32), self.bases, 1)

    def columns(self, weights: NDArray, bright: Image) -> Image:
        """Images of the linear unknowns (k + w + b + s, ny, nx): bases, what light scattered widely adds to the disk of
        the bases' weights (k,), whose brightness is `bright` (ny, nx), background, and what the disk changes by per
        degree of the Sun's direction."""
        return np.concatenate([self.bases, self.scattered(bright), self.background, self.turned_sun(weights)])

    def turned_sun(self, weights: NDArray) -> Image:
        """Change of the disk (s, ny, nx) per degree of turn of the Sun's direction, at the bases' weights (k,)."""
        out = np.empty((len(self.by_sun), *self.window.shape), np.float32)
        for number, shades in enumerate(self.by_sun):
            change = _weighted(shades[: self.mapped], weights[: self.mapped]) * self.surface.albedo
            change = change + _weighted(shades[self.mapped :], weights[self.mapped : len(shades)])
            out[number] = smeared(detect(change, self.oversample, self.state.psf_sigma_px), self.state.trail_px)
        return out

    def scattered(self, bright: Image) -> Image:
        """The disk, `bright` (ny, nx), blurred widely less the disk (w, ny, nx), one for each width of `wings_px`."""
        import cv2

        wide = [cv2.GaussianBlur(bright, (0, 0), width, borderType=cv2.BORDER_REPLICATE) for width in self.wings_px]
        return np.array([image - bright for image in wide], np.float32).reshape(-1, *bright.shape)

    def local(self, bright: Image) -> Image:
        """Images of a tile's unknowns (LOCAL, ny, nx), where the disk is `bright` (ny, nx): gain, its two slopes, and
        an even veil as bright as the disk."""
        veil = np.full_like(bright, bright.max())
        return np.stack([bright, bright * self.tiles.along, bright * self.tiles.across, veil])

    def trail_columns(self, weights: NDArray, gain: Image) -> Image:
        """Change of the image per pixel of the trail's x and y (2, ny, nx); none (0, ny, nx) without a trail."""
        if not any(self.state.trail_px):
            return np.empty((0, *self.window.shape), np.float32)
        sharp = np.tensordot(np.asarray(weights, np.float32), self.sharp, 1)
        return np.asarray(trail_columns(sharp, self.state.trail_px) * (1 + gain))

    def derivatives(self, weights: NDArray, gain: Image) -> Image:
        """Change of the image (8, ny, nx) per unit of each unknown of `parameters.NAMES`, at the bases'
        weights (k,) and the tiles' gains (ny, nx)."""
        s, sigma = self.oversample, self.state.psf_sigma_px
        shading = _weighted(self.shades[: self.mapped], weights[: self.mapped])
        fine = shading * self.surface.albedo
        fine += _weighted(self.shades[self.mapped :], weights[self.mapped :])
        out = np.empty((len(NAMES), *self.window.shape), np.float32)
        changes_of_place(fine, self.centre_px, s, sigma, out)
        for number, axis in enumerate(range(ATTITUDE.start, ATTITUDE.stop)):
            out[axis] = detect(shading * self.surface.albedo_per_deg[number], s, sigma)
        for number, change in enumerate(out):
            out[number] = smeared(change, self.state.trail_px)
        out *= 1 + gain
        return out


def _weighted(images: list[Image], weights: NDArray) -> Image:
    total = np.zeros((), np.float32)
    for image, weight in zip(images, weights, strict=True):
        total = total + np.float32(weight) * image
    return total


def linear_model(given: Problem, state: State, window: Window, tiles: Tiles, behind: Image | None = None) -> Model:
    """Find the surface at `state` and prepare everything that the linear fit and the derivatives need. behind: (ny, nx)
    light that the disk hides, or None."""
    scene, settings = given.scene, given.settings
    s = settings.oversample or scene.oversample_for(state.pose)
    pose = state.pose
    shines = shines_of(pose, scene.target, scene.settings.others)
    surface = fine_surface(scene, pose, window, s, night=bool(shines))
    cosines = cosines_of(shines, pose, scene.camera, scene.target, window, s)
    chosen = (*laws(settings.mapped), *laws(settings.plain))
    shade = {
        law: with_shines(law, surface.mu0, surface.mu, pose.phase_deg, shines, cosines) * surface.cover
        for law in set(chosen)
    }
    shades = [shade[law] for law in chosen]
    if behind is not None:
        shades.append(-finer(behind, s) * surface.cover)
    fine = [each * surface.albedo if k < len(settings.mapped) else each for k, each in enumerate(shades)]
    centre = scene.camera.project(state.pose.target_in_camera_km) - (window.x0, window.y0)
    radius = disk_radius_px(state.pose, scene.camera, scene.target)
    sharp = np.stack([detect(each, s, state.psf_sigma_px) for each in fine])
    bases = np.stack([smeared(each, state.trail_px) for each in sharp]) if any(state.trail_px) else sharp
    return Model(
        state=state,
        window=window,
        oversample=s,
        surface=surface,
        shades=shades,
        mapped=len(settings.mapped),
        bases=bases,
        sharp=sharp,
        background=_polynomials(window.shape, centre, radius, 1 if settings.background == "plane" else 0),
        coverage=smeared(detect(surface.cover, s, state.psf_sigma_px), state.trail_px),
        mu0=detect(surface.mu0 * surface.cover, s, 0.0),
        centre_px=centre,
        tiles=tiles,
        wings_px=settings.wings_px,
        hides=int(behind is not None),
        by_sun=changes_by_sun(scene, state.pose, window, s, chosen, surface) if given.sun_deg > 0 else (),
        sun_deg=given.sun_deg,
    )


def changes_by_sun(
    scene: Scene,
    pose: Pose,
    window: Window,
    oversample: int,
    laws: tuple[Law, ...],
    here: FineSurface,
) -> tuple[list[Image], ...]:
    """For each of two turns of the Sun's direction about axes across it, what the shades of the laws at `pose`, whose
    surface is `here`, change by per degree."""
    before = {law: law(here.mu0, here.mu, pose.phase_deg) * here.cover for law in set(laws)}
    changes = []
    for axis in axes_across(pose.sun_from_target_km):
        moved = pose.replaced(sun_from_target_km=rotation_from_vector_deg(axis) @ pose.sun_from_target_km)
        there = fine_surface(scene, moved, window, oversample)
        change = {law: law(there.mu0, here.mu, pose.phase_deg) * here.cover - before[law] for law in before}
        changes.append([change[law] for law in laws])
    return tuple(changes)


def axes_across(direction: NDArray) -> NDArray:
    """Two unit vectors (2, 3) across a direction (3,) and each other."""
    along = direction / np.linalg.norm(direction)
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(along, first)])


def _polynomials(shape: tuple[int, int], centre: NDArray, radius: float, degree: int) -> Image:
    """Products of Legendre polynomials (n, ny, nx) of total degree up to `degree`, the constant first; the disk spans
    -1 to 1, and beyond it they keep the value of its edge."""
    from numpy.polynomial.legendre import legvander

    x, y = ((np.arange(n) - c) / radius for n, c in zip(shape[::-1], centre, strict=True))
    along, down = (legvander(np.clip(v, -1.1, 1.1), degree) for v in (x, y))
    powers = [(i, total - i) for total in range(degree + 1) for i in range(total + 1)]
    return np.stack([np.outer(down[:, j], along[:, i]) for i, j in powers]).astype(np.float32)
