"""How much better one explanation fits the image than another one, and than chance.

Explanations are compared over the same pixels: those of both disks and a rim of sky. Errors of neighbouring pixels go
together, so that a disk has fewer independent pixels than pixels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.flips import flipped
from catalog.observation import Observation
from catalog.pose import Pose
from tasks.compare.brightness import fit_brightness
from tasks.compare.match import framed_window, match_scene
from tasks.compare.reduce import reduced_observation, reduced_scene
from tasks.diagnose.candidates import BACK, Candidate
from tasks.point.coarse import lit_width_px, without_specks
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Image = NDArray[np.float64]
ACROSS = 120.0
RIM_PX, RIM_RADII = 4.0, 0.3
# Errors go together in blocks: so many of them across the disk.
BLOCKS_ACROSS = 12
FEWEST_PIXELS = 50
LEAST_SHARED = 0.5


@dataclass(frozen=True)
class Fit:
    """All (ny, nx) of the reduced frame as it was taken: residual, image minus simulation, and sky, image minus the sky
    around the target, as if none were there; both NaN where the candidate's image is not usable. near: disk and rim.
    block_px: side of the blocks in which errors go together."""

    residual: Image
    sky: Image
    near: NDArray[np.bool_]
    block_px: int


def fit_of(candidate: Candidate, observation: Observation, pose: Pose, scene: Scene, n: int) -> Fit:
    """Of a candidate whose picture is `observation`, settled at `pose`, over cells of n x n pixels."""
    seen = reduced_observation(without_specks(observation, lit_width_px(pose, scene)), n)
    small = reduced_scene(candidate.seen_by(scene), n)
    radius = disk_radius_px(pose, small.camera, small.target)
    margin, block_px = RIM_PX + RIM_RADII * radius, max(2, round(2 * radius / BLOCKS_ACROSS))
    match = match_scene(seen, small.coarser(pose, ACROSS), pose, framed_window(small, pose, margin))
    model, coefficients = fit_brightness(match, match.simulation.bases)
    window = match.simulation.window
    usable = seen.usable
    image = np.where(usable, seen.image, np.nan).astype(np.float64)
    ny, nx = image.shape
    inside = window.clipped((nx, ny))
    place = np.s_[inside.y0 : inside.y1, inside.x0 : inside.x1]
    part = np.s_[inside.y0 - window.y0 : inside.y1 - window.y0, inside.x0 - window.x0 : inside.x1 - window.x0]
    near = np.zeros(image.shape, bool)
    near[place] = True
    around = near & usable
    around[place] &= match.simulation.coverage[part] < 1e-3
    level = float(np.median(image[around])) if around.any() else float(coefficients[-1])
    sky = image - level
    residual = sky.copy()
    residual[place] = image[place] - model[part]
    if candidate.flip:
        residual, sky, near = (flipped(a, BACK.get(candidate.flip, candidate.flip)) for a in (residual, sky, near))
    return Fit(residual, sky, near, block_px)


def better_by(fit: Fit, other: Fit) -> tuple[float, float]:
    """How many times as large the other one's mean square is, over pixels that both have, and by how many sigmas that
    is more than accident. Where those hold little of the target's light, as behind a mask, the other explains nothing.

    The difference of the squares is summed over blocks, whose scatter tells its error: neither explanation contains the
    other, so that the number of unknowns tells nothing (Vuong 1989, Econometrica 57, 307).
    """
    both = (fit.near | other.near) & np.isfinite(fit.residual) & np.isfinite(other.residual)
    light = np.where(fit.near & np.isfinite(fit.residual), fit.sky, 0) ** 2
    if light[np.isfinite(other.residual)].sum() < LEAST_SHARED * light.sum():
        ratio, gain = better_than_sky(fit)
        return ratio, float(np.sqrt(2 * max(gain, 0.0)))
    mine, its = (np.where(both, residual, 0) ** 2 for residual in (fit.residual, other.residual))
    if np.count_nonzero(both) < FEWEST_PIXELS or mine.sum() <= 0:
        return 1.0, 0.0
    gains = block_sums(its - mine, fit.block_px)
    scatter = float(np.sqrt((gains**2).sum()))
    return float(its.sum() / mine.sum()), float(gains.sum()) / scatter if scatter > 0 else 0.0


def better_than_sky(fit: Fit) -> tuple[float, float]:
    """How many times as large the mean square would be without a target, and the gain in log-likelihood that this is
    worth: n/2 times the ratio's logarithm, with n the number of independent pixels."""
    meant = fit.near & np.isfinite(fit.residual)
    residual = np.where(meant, fit.residual, 0)
    count, squares = int(np.count_nonzero(meant)), float((residual**2).sum())
    if count < FEWEST_PIXELS or squares <= 0:
        return 1.0, 0.0
    ratio = float((np.where(meant, fit.sky, 0) ** 2).sum()) / squares
    wide = fit.block_px * 3 // 2  # what the sky may hold is smoother than what an explanation leaves
    together = shared(np.where(meant, fit.sky, 0) if ratio < 2 else residual, wide)
    return ratio, 0.5 * count / together * float(np.log(max(ratio, 1e-12)))


def shared(residual: Image, block_px: int) -> float:
    """How many pixels err together: mean square of the sums over blocks by that of single pixels, 1 at least."""
    squares = float((residual**2).sum())
    return max(float((block_sums(residual, block_px) ** 2).sum()) / squares, 1.0) if squares > 0 else 1.0


def block_sums(values: Image, block_px: int) -> Image:
    """Sums over blocks of block_px to a side; the last ones are filled up with 0."""
    ny, nx = (-(-size // block_px) * block_px for size in values.shape)
    padded = np.zeros((ny, nx))
    padded[: values.shape[0], : values.shape[1]] = values
    return np.asarray(padded.reshape(ny // block_px, block_px, nx // block_px, block_px).sum(axis=(1, 3)))
